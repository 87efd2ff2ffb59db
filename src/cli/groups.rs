//! `gdtof --help`: the commands by what they are for. clap has headings for options alone, so the list is a template.

use std::fmt::Write;

use clap::Command;

/// Every command, in the order in which a newcomer needs them.
const GROUPS: [(&str, &[&str]); 6] = [
    ("Take frames", &["frame", "drive", "demo", "photons"]),
    (
        "Look at results",
        &["page", "wave", "range", "stereo", "export"],
    ),
    (
        "Look into the chip",
        &["replay", "timing", "power", "calibrate"],
    ),
    ("Study", &["propose", "sweep", "pareto", "speed"]),
    ("Check", &["tb", "reproduce"]),
    (
        "Settings and help",
        &[
            "sensor",
            "scene",
            "schema",
            "doctor",
            "completion",
            "man",
            "help",
        ],
    ),
];

/// The command with its subcommands in groups in its help.
pub(super) fn grouped(command: Command) -> Command {
    let mut built = command.clone();
    built.build();
    let styles = built.get_styles();
    let (header, literal) = (styles.get_header(), styles.get_literal());
    let mut list = String::new();
    for (heading, names) in GROUPS {
        let _ = writeln!(list, "{header}{heading}:{header:#}");
        let commands = names.iter().filter_map(|name| built.find_subcommand(name));
        for command in commands {
            let about = command.get_about().map(ToString::to_string);
            let (name, about) = (command.get_name(), about.unwrap_or_default());
            let _ = writeln!(list, "  {literal}{name:10}{literal:#}  {about}");
        }
        list.push('\n');
    }
    command.help_template(format!(
        "{{about-with-newline}}\n{{usage-heading}} {{usage}}\n\n{list}{header}Options:{header:#}\n{{options}}"
    ))
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;
    use crate::cli::Cli;

    #[test]
    fn every_command_is_in_one_group() {
        let mut command = Cli::command();
        command.build();
        let mut commands: Vec<&str> = command.get_subcommands().map(Command::get_name).collect();
        let mut grouped: Vec<&str> = GROUPS.iter().flat_map(|group| group.1).copied().collect();
        commands.sort_unstable();
        grouped.sort_unstable();
        assert_eq!(grouped, commands);
    }

    #[test]
    fn help_lists_every_command_with_what_it_does() {
        let help = grouped(Cli::command()).render_help().to_string();
        for command in Cli::command().get_subcommands() {
            let line = format!(
                "  {:10}  {}\n",
                command.get_name(),
                command.get_about().unwrap()
            );
            assert!(help.contains(&line), "{line}{help}");
        }
    }
}
