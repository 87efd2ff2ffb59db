//! The parts of the page put together. Names that users chose go in as JSON that no browser takes for markup, and the title as escaped text.

use super::packed::Packed;

const TEMPLATE: &str = include_str!("page.html");
/// What every page begins with.
pub(super) const SIGNATURE: &str = "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"generator\" content=\"gdtof page\">\n";
const PLOTLY: &str = include_str!("plotly.min.js");
const STYLE: &str = include_str!("page.css");

/// In the order in which they run.
const SCRIPTS: [&str; 7] = [
    include_str!("data.js"),
    include_str!("looks.js"),
    include_str!("raster.js"),
    include_str!("maps.js"),
    include_str!("histogram.js"),
    include_str!("cloud.js"),
    include_str!("main.js"),
];

/// The whole file.
pub(super) fn assemble(packed: &Packed) -> String {
    let meta = serde_json::to_string(&packed.meta).expect("plain data");
    let mut html = String::new();
    let mut rest = TEMPLATE;
    while let Some((before, after)) = rest.split_once("{{") {
        let (name, after) = after.split_once("}}").expect("our template");
        html.push_str(before);
        match name {
            "title" => html.push_str(&escaped(&packed.meta.title)),
            "style" => html.push_str(STYLE),
            "plotly" => html.push_str(PLOTLY),
            "meta" => html.push_str(&in_script(&meta)),
            "frames" => frames(&mut html, packed),
            "scripts" => {
                html.push_str("(() => {\n\"use strict\";\n");
                html.push_str(&SCRIPTS.concat());
                html.push_str("})();\n");
            }
            other => unreachable!("{other}"),
        }
        rest = after;
    }
    html.push_str(rest);
    html
}

/// Every frame in an element of its own, which is read when it is looked at.
fn frames(html: &mut String, packed: &Packed) {
    for (at, frame) in packed.frames.iter().enumerate() {
        html.push_str(&format!(
            "<script type=\"application/octet-stream\" id=\"frame-{at}\">{frame}</script>\n"
        ));
    }
}

/// Text between tags.
fn escaped(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            c => escaped.push(c),
        }
    }
    escaped
}

/// JSON inside a script element, which ends at `</script` and changes at `<!--`, whatever stands in strings.
fn in_script(json: &str) -> String {
    json.replace('<', "\\u003c")
        .replace('\u{2028}', "\\u2028")
        .replace('\u{2029}', "\\u2029")
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn no_text_leaves_its_place(text in "(</script>|<!--|<script>|&|\"|'|\\PC|\u{2028}){0,20}") {
            prop_assert!(!escaped(&text).contains(['<', '>', '"', '\'']));
            let json = serde_json::to_string(&text).unwrap();
            let placed = in_script(&json);
            prop_assert!(!placed.contains('<'));
            prop_assert_eq!(serde_json::from_str::<String>(&placed).unwrap(), text);
        }
    }

    #[test]
    fn our_own_parts_do_not_end_their_elements() {
        for part in SCRIPTS.iter().chain([&PLOTLY]) {
            assert!(!part.contains("</script"));
        }
        assert!(!STYLE.contains("</style"));
    }
}
