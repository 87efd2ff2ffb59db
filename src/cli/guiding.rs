//! `--guide` and `--windows`: where targets are expected, and how macropixels choose their windows by it.

use clap::Args;

use crate::guide::options;
use crate::request::FrameRequest;
use crate::settings::{Key, Settings};
use crate::system::WindowPolicy;

/// How windows are guided.
#[derive(Args)]
pub(super) struct GuideArgs {
    /// Guide for the windows, such as radar or radar:range_sigma_m=0.2,azimuth_beam_deg=4 [default: stereo, the
    /// scene's camera pair]. Several are fused by their variances. `--help` lists all guides with their keys.
    #[arg(long = "guide", value_name = "NAME[:KEY=VALUE,…]", long_help = guides_in_full())]
    /// Guides as they were given; none for the camera pair.
    pub(super) guides: Vec<String>,
    /// How windows are chosen, such as unguided=neighbour. `--help` lists all keys.
    #[arg(long, value_name = "KEY=VALUE,…", long_help = policy_in_full())]
    windows: Option<String>,
    /// Slow CLK down until windows are as long as the guide's claimed errors require (the policy's `within`). The
    /// length of a laser cycle stays the same.
    #[arg(long)]
    bins_from_guide: bool,
}

impl GuideArgs {
    /// Adds guide and windows to a request.
    pub(super) fn ask(&self, request: FrameRequest) -> FrameRequest {
        FrameRequest {
            guides: self.guides.clone(),
            windows: self.windows.clone().unwrap_or_default(),
            bins_from_guide: self.bins_from_guide,
            ..request
        }
    }
}

fn guides_in_full() -> String {
    let mut text = "Guide for the windows: a name, or a name with keys, such as \
        radar:range_sigma_m=0.2,azimuth_beam_deg=4 [default: stereo]. Several --guide are fused by their variances.\n"
        .to_owned();
    for kind in options::KINDS {
        text += &format!("\n{}: {}\n", kind.name, kind.what);
        text += &keys_in_full(kind.keys);
    }
    text
}

fn policy_in_full() -> String {
    let keys = keys_in_full(WindowPolicy::KEYS);
    format!("How windows are chosen, such as unguided=neighbour,overlap=0.3:\n{keys}")
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
