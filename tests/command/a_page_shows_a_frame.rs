//! `gdtof page`: one file that needs no network, whatever names the scene has, and that works in a browser.

use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use super::tools::gdtof;

/// A name that ends a script and begins another.
const BREAKS_OUT: &str = "</script><script>document.title='broken into'</script><!--";

/// A wall that has the name, in a file with a name that shells and browsers take amiss.
fn scene_file(folder: &Path) -> PathBuf {
    let file = folder.join("it's <b>.toml");
    let text = format!(
        "[[object]]\nname = {BREAKS_OUT:?}\nkind = \"plane\"\nreflectivity = 0.5\ncentre_m = [0, 0, 30]\nwidth_m = 100\nheight_m = 100\n"
    );
    std::fs::write(&file, text).unwrap();
    file
}

/// Takes a frame of the wall with its page beside it, and makes the page anew.
fn taken(folder: &Path) -> (String, Value) {
    let scene = scene_file(folder);
    let size = ["--rows", "8", "--cols", "8", "--laser-cycles", "60"];
    let dark = ["--set", "scene.light.illuminance_klux=1"];
    let frame = ["frame", "--scene", scene.to_str().unwrap(), "--page"];
    let rest = ["--probe", "none", "--out", "out"];
    let done = gdtof(folder, &[&frame[..], &size, &dark, &rest].concat());
    assert!(done.status.success(), "{done:?}");
    let again = gdtof(folder, &["page", "out", "-o", "again.html", "--json"]);
    assert!(again.status.success(), "{again:?}");
    let page = std::fs::read_to_string(folder.join("again.html")).unwrap();
    let report: Value = serde_json::from_slice(&again.stdout).unwrap();
    assert_eq!(report["frames"], 1);
    assert_eq!(report["bytes"], page.len());
    let beside = std::fs::read_to_string(folder.join("out/page.html")).unwrap();
    assert!(beside == page, "the page beside the frame differs");
    let json = std::fs::read_to_string(folder.join("out/frame.json")).unwrap();
    (page, serde_json::from_str(&json).unwrap())
}

#[test]
fn a_page_is_one_file_and_names_stay_names() {
    let dir = tempfile::tempdir().unwrap();
    let (page, _) = taken(dir.path());
    assert!(!page.contains("<script>document.title"));
    assert!(page.contains("it&#39;s &lt;b&gt;.toml"));
    // Meta, one frame, plotly, ours.
    assert_eq!(page.matches("<script").count() - 4, our_mentions(&page));
    let (before, _) = page.split_once("/* plotly.js").unwrap();
    for outside in ["http:", "https:", "src=", "@import", "url("] {
        assert!(!before.contains(outside), "{outside}");
    }
}

/// What plotly.js says of script elements in its strings.
fn our_mentions(page: &str) -> usize {
    let (_, plotly) = page.split_once("/* plotly.js").unwrap();
    let (plotly, _) = plotly.split_once("</script>").unwrap();
    plotly.matches("<script").count()
}

#[test]
fn what_has_no_page_is_refused_in_a_sentence() {
    let dir = tempfile::tempdir().unwrap();
    let refused = |arguments: &[&str], says: &str| {
        let done = gdtof(dir.path(), arguments);
        let complaint = String::from_utf8_lossy(&done.stderr).into_owned();
        assert_eq!(done.status.code(), Some(2), "{complaint}");
        assert!(complaint.contains(says), "{complaint}");
        assert_eq!(complaint.lines().count(), 1, "{complaint}");
        assert!(!dir.path().join("page.html").exists());
    };
    refused(&["page", "nowhere"], "neither frame.json nor drive.json");
    std::fs::create_dir(dir.path().join("old")).unwrap();
    let old = dir.path().join("old/frame.json");
    std::fs::write(&old, "{\"version\": \"0.0.1\"}").unwrap();
    refused(&["page", "old"], "written by version 0.0.1");
    std::fs::write(&old, "[1, 2").unwrap();
    refused(&["page", "old"], "frame.json:1");
}

const BROWSERS: [&str; 3] = ["chromium", "chromium-browser", "google-chrome"];

fn browser() -> Option<&'static str> {
    let runs = |name: &&&str| {
        let asked = Command::new(name).arg("--version").output();
        asked.is_ok_and(|done| done.status.success())
    };
    BROWSERS.iter().find(runs).copied()
}

/// Put first into the page: keeps what goes wrong.
const WATCHES: &str = r#"<script>
window.bad = [];
addEventListener("error", (event) => bad.push(event.message));
addEventListener("unhandledrejection", (event) => bad.push(String(event.reason)));
console.error = (...words) => bad.push(words.join(" "));
</script>"#;

/// Put last: uses the page as a reader would, and leaves what it saw, URL-encoded.
const USES: &str = r##"<script>
(async () => {
  const root = document.documentElement;
  const text = (id) => document.getElementById(id).textContent;
  const press = (key) => document.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true }));
  for (let i = 0; i < 400 && !root.dataset.ready; i++) await new Promise((go) => setTimeout(go, 50));
  const saw = { ready: root.dataset.ready, title: document.title };
  const map = document.getElementById("map-depth");
  const at = map.getBoundingClientRect();
  map.dispatchEvent(new PointerEvent("pointerdown", { clientX: at.left + at.width * 2.5 / 8, clientY: at.top + at.height * 5.5 / 8 }));
  saw.clicked = text("which");
  saw.numbers = Object.fromEntries([...document.querySelectorAll("#numbers tr")].map((line) => [line.cells[0].textContent, line.cells[1].textContent]));
  saw.command = text("command");
  saw.curves = document.getElementById("histogram").data.length;
  saw.points = document.getElementById("points").data?.[0].x.length ?? text("points");
  press("ArrowRight");
  press("ArrowUp");
  saw.moved = text("which");
  saw.address = location.hash;
  const before = root.dataset.theme;
  press("t");
  await new Promise((go) => setTimeout(go, 300));
  saw.theme = before + " " + root.dataset.theme;
  saw.bad = bad;
  const result = document.createElement("pre");
  result.textContent = "SAW:" + encodeURIComponent(JSON.stringify(saw)) + ":";
  document.body.replaceChildren(result);
})();
</script>"##;

/// Percent-encoded text.
fn decoded(text: &str) -> String {
    let mut bytes = Vec::new();
    let mut rest = text.bytes();
    while let Some(b) = rest.next() {
        bytes.push(match b {
            b'%' => {
                let digits: Vec<u8> = rest.by_ref().take(2).collect();
                u8::from_str_radix(std::str::from_utf8(&digits).unwrap(), 16).unwrap()
            }
            b => b,
        });
    }
    String::from_utf8(bytes).unwrap()
}

/// What a script saw that runs at the end of a page in a browser, and that nothing went wrong; `None` without a browser.
pub(super) fn seen_in_a_browser(page: &str, script: &str) -> Option<Value> {
    let Some(browser) = browser() else {
        eprintln!("SKIPPED: no chromium here, so the page is not opened; install chromium");
        return None;
    };
    let dir = tempfile::tempdir().unwrap();
    let (head, rest) = page.split_once("<head>").unwrap();
    let (body, end) = rest.rsplit_once("</body>").unwrap();
    let file = dir.path().join("watched.html");
    std::fs::write(
        &file,
        format!("{head}<head>{WATCHES}{body}{script}</body>{end}"),
    )
    .unwrap();
    let profile = dir.path().join("profile");
    let mut command = Command::new(browser);
    command
        .args(["--headless", "--no-sandbox", "--disable-gpu"])
        .args(["--disable-quic", "--no-first-run", "--disable-sync"])
        .args([
            "--disable-background-networking",
            "--disable-component-update",
        ])
        // Plots in space without a graphics card.
        .args(["--use-angle=swiftshader", "--enable-unsafe-swiftshader"])
        .args(["--virtual-time-budget=60000", "--dump-dom"])
        .arg(format!("--user-data-dir={}", profile.display()))
        .arg(format!("file://{}", file.display()));
    let shown = command.output().unwrap();
    let dom = String::from_utf8_lossy(&shown.stdout);
    let saw = dom.split("SAW:").nth(1).unwrap_or_else(|| {
        panic!(
            "the page came to nothing: {}",
            String::from_utf8_lossy(&shown.stderr)
        )
    });
    let saw: Value = serde_json::from_str(&decoded(saw.split(':').next().unwrap())).unwrap();
    assert_eq!(saw["bad"], serde_json::json!([]), "{saw}");
    assert_eq!(saw["ready"], "yes");
    Some(saw)
}

#[test]
fn a_browser_shows_the_page_and_follows_click_and_keys() {
    let dir = tempfile::tempdir().unwrap();
    let (page, frame) = taken(dir.path());
    let Some(saw) = seen_in_a_browser(&page, USES) else {
        return;
    };
    let title = saw["title"].as_str().unwrap();
    assert!(
        title.starts_with("Frame of ") && title.ends_with("it's <b>.toml"),
        "{title}"
    );
    assert_eq!(saw["clicked"], "Macropixel 5, 2");
    assert_eq!(saw["moved"], "Macropixel 4, 3");
    assert_eq!(saw["address"], "#r4c3f0");
    assert!(["light dark", "dark light"].contains(&saw["theme"].as_str().unwrap()));
    let command = "gdtof wave --frame out/frame.json --pixel 5,2 --cycle 1";
    assert_eq!(saw["command"], command);
    let numbers = &saw["numbers"];
    assert_eq!(numbers["sees"], BREAKS_OUT);
    let pixels = frame["macropixels"].as_array().unwrap();
    let metres = |m: &Value| m.as_f64().map_or("–".into(), |m| format!("{m:.3} m"));
    let pixel = &pixels[5 * 8 + 2];
    assert_eq!(numbers["guide"], metres(&pixel["guide_m"]));
    assert_eq!(numbers["depth"], metres(&pixel["measured_m"]));
    let returns = |p: &Value| p["returns"].as_array().map_or(0, Vec::len);
    let points: usize = pixels.iter().map(returns).sum();
    assert!(points > 0);
    assert_eq!(saw["points"], points);
    assert_eq!(numbers["further returns"], "–");
    // The histogram itself, and the fit.
    assert_eq!(saw["curves"], 2);
}
