//! `gdtof completion`, `gdtof man` and `gdtof schema`: the command and its files, described for shells, readers and
//! editors.

use std::path::PathBuf;

use clap::{Args, Command, ValueEnum};
use clap_complete::Shell;

use super::voice::{notes, say_file, say_unless_quiet};
use crate::chip::SensorConfig;
use crate::files::{OutputFile, ResultSet};
use crate::scene::Scene;
use crate::sweep::Study;

/// Arguments of `gdtof completion`.
#[derive(Args)]
pub(super) struct CompletionArgs {
    /// Shell to write the script for.
    #[arg(value_enum)]
    shell: Shell,
}

/// Arguments of `gdtof man`.
#[derive(Args)]
pub(super) struct ManArgs {
    /// Folder for gdtof.1 and a page for each command; created if missing.
    #[arg(long, value_name = "DIR", default_value = "man")]
    out: PathBuf,
}

/// A kind of file that users write.
#[derive(Clone, Copy, ValueEnum)]
enum File {
    /// A sensor.
    Sensor,
    /// A scene.
    Scene,
    /// A study of `gdtof sweep`.
    Study,
}

/// Arguments of `gdtof schema`.
#[derive(Args)]
pub(super) struct SchemaArgs {
    /// Kind of file.
    #[arg(value_enum)]
    file: File,
}

/// Prints a script that completes the command's options.
///
/// # Errors
/// When it cannot be written.
pub(super) fn completion(args: &CompletionArgs, mut command: Command) -> anyhow::Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut command, "gdtof", &mut script);
    Ok(say_file(String::from_utf8_lossy(&script))?)
}

/// Writes manual pages.
///
/// # Errors
/// When they cannot be written.
pub(super) fn man(args: &ManArgs, command: Command) -> anyhow::Result<()> {
    let set = ResultSet::begin(&args.out, "man")?;
    let mut pages = Vec::new();
    let mut commands = vec![command.disable_help_subcommand(true)];
    while let Some(mut command) = commands.pop() {
        command.build();
        let name = command
            .get_display_name()
            .unwrap_or_else(|| command.get_name())
            .to_owned();
        let path = set.staging().join(format!("{name}.1"));
        OutputFile::write_with(&path, |out| {
            clap_mangen::Man::new(command.clone()).render(out)
        })?;
        let children = command.get_subcommands().filter(|c| !c.is_hide_set());
        commands.extend(children.filter(|c| c.get_name() != "help").cloned());
        pages.push(name);
    }
    notes(set.commit(())?);
    let (folder, many) = (args.out.display(), pages.len());
    Ok(say_unless_quiet(format_args!(
        "{many} pages in {folder}: man -l {folder}/gdtof.1\n"
    ))?)
}

/// Prints the JSON schema of a kind of file.
///
/// # Errors
/// When it cannot be written.
pub(super) fn schema(args: &SchemaArgs) -> anyhow::Result<()> {
    let schema = match args.file {
        File::Sensor => SensorConfig::schema(),
        File::Scene => Scene::schema(),
        File::Study => Study::schema(),
    };
    Ok(say_file(format_args!("{schema:#}\n"))?)
}
