//! `gdtof pareto`: run time against error. For now the errors alone: numerical stability of the functions that
//! everything rests on.

use anyhow::bail;
use clap::Args;

use super::say;
use crate::system::stability;

/// Arguments of `gdtof pareto`.
#[derive(Args)]
#[command(arg_required_else_help = true)]
pub struct ParetoArgs {
    /// Worst error of each function against references of 25 digits, at extreme arguments.
    #[arg(long, required = true)]
    stability: bool,
    /// Markdown instead of a table for the terminal.
    #[arg(long)]
    markdown: bool,
}

/// Runs the command.
///
/// # Errors
/// A function that breaks its promise.
pub fn run(args: &ParetoArgs) -> anyhow::Result<()> {
    if args.stability {
        let (table, kept) = stability::table();
        if args.markdown {
            say(table.markdown())?;
        } else {
            say(table)?;
        }
        if !kept {
            bail!("a function is further from its reference than it promises");
        }
    }
    Ok(())
}
