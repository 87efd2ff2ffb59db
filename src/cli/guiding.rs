//! `--guide` and `--windows`: what tells where targets are, and what macropixels make of it.

use clap::Args;

use crate::guide::options;
use crate::request::FrameRequest;
use crate::settings::Key;
use crate::system::POLICY_KEYS;

/// How windows are guided.
#[derive(Args)]
pub(super) struct GuideArgs {
    /// What guides the windows, as radar or radar:range_sigma_m=0.2,azimuth_beam_deg=4; the scene's camera pair without it. Several are
    /// fused by their variances. `--help` lists all with their keys.
    #[arg(long = "guide", value_name = "NAME[:KEY=VALUE,…]", long_help = guides_in_full())]
    guides: Vec<String>,
    /// How windows are chosen, as unguided=neighbour. `--help` lists all keys.
    #[arg(long, value_name = "KEY=VALUE,…", long_help = policy_in_full())]
    windows: Option<String>,
    /// Slow CLK down until windows hold what the guide claims of its errors (the policy's `within`); laser cycles last as long as before.
    #[arg(long)]
    bins_from_guide: bool,
}

impl GuideArgs {
    /// Adds to a request what is asked of guide and windows.
    pub(super) fn ask(&self, request: FrameRequest) -> FrameRequest {
        FrameRequest {
            guides: self.guides.clone(),
            windows: self.windows.clone().unwrap_or_default(),
            bins_from_guide: self.bins_from_guide,
            ..request
        }
    }

    /// Guides as they were asked for; none for the camera pair.
    pub(super) fn guides(&self) -> &[String] {
        &self.guides
    }
}

fn guides_in_full() -> String {
    let mut text = "What guides the windows: a name, or a name with its keys, as \
        radar:range_sigma_m=0.2,azimuth_beam_deg=4. Without it, stereo. Several --guide are fused by their variances.\n"
        .to_owned();
    for kind in options::KINDS {
        text += &format!("\n{}: {}\n", kind.name, kind.what);
        text += &keys_in_full(kind.keys);
    }
    text
}

fn policy_in_full() -> String {
    let keys = keys_in_full(POLICY_KEYS);
    format!("How windows are chosen, as unguided=neighbour,overlap=0.3:\n{keys}")
}

fn keys_in_full(keys: &[Key]) -> String {
    let line = |key: &Key| {
        let unit = if key.unit.is_empty() { "" } else { " " };
        format!(
            "  {}: {}; {}{unit}{}\n",
            key.name, key.what, key.range, key.unit
        )
    };
    keys.iter().map(line).collect()
}
