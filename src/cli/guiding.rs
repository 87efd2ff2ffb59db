//! `--guide` and `--windows`: what tells where targets are, and what macropixels make of it.

use std::sync::Arc;

use clap::Args;

use crate::chip::{SensorConfig, Tdc};
use crate::files::InputError;
use crate::guide::{BehaviouralStereo, Guide, GuideInput, options};
use crate::scene::Scene;
use crate::settings::Key;
use crate::system::{FrameError, POLICY_KEYS, WindowPolicy};

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
    /// The guide, and `policy` with what is asked of it.
    ///
    /// # Errors
    /// Unknown guides, bad keys and values, unreadable maps.
    pub(super) fn read(
        &self,
        policy: WindowPolicy,
    ) -> Result<(Arc<dyn Guide>, WindowPolicy), InputError> {
        let policy = match &self.windows {
            Some(text) => policy.with(text, "--windows")?,
            None => policy,
        };
        if self.guides.is_empty() {
            return Ok((Arc::new(BehaviouralStereo), policy));
        }
        let guides = self.guides.iter().map(String::as_str);
        Ok((options::parse_all(guides, "--guide")?, policy))
    }

    /// The sensor and the CLK periods of a laser cycle, with the bins that the guide's errors ask for, if that is wanted.
    ///
    /// # Errors
    /// A guide without a map, and one that no bins hold.
    pub(super) fn with_bins(
        &self,
        (guide, policy): (&dyn Guide, &WindowPolicy),
        sensor: SensorConfig,
        scene: &Scene,
        (stop_periods, seed): (u32, u64),
    ) -> anyhow::Result<(SensorConfig, u32)> {
        if !self.bins_from_guide {
            return Ok((sensor, stop_periods));
        }
        let input = GuideInput::still(scene, sensor.rows as u32, sensor.cols as u32, seed);
        let map = guide.estimate(&input).map_err(FrameError::Guide)?;
        let slowed = policy.slowed(&map, &sensor, stop_periods);
        Ok(slowed.ok_or_else(|| {
            let message = match sensor.tdc {
                Tdc::DelayLine => "bins of delay lines do not follow CLK; leave it out",
                Tdc::Clocked => "no CLK makes bins that hold what this guide claims; give another guide or a smaller --windows within",
            };
            InputError::new("--bins-from-guide", message)
        })?)
    }

    /// Guides as they were asked for; none for the camera pair.
    pub(super) fn guides(&self) -> &[String] {
        &self.guides
    }

    /// The policy's keys as they were asked for.
    pub(super) fn windows(&self) -> Option<&str> {
        self.windows.as_deref()
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
