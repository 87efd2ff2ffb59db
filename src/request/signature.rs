//! The name that files carry.

/// From now on waveforms, their layouts, activity and delay files name this program as their writer.
pub fn sign_files() {
    let origin = guided_dtof_sensor::Origin {
        vendor: "guided-dtof",
        program: "gdtof",
        version: env!("CARGO_PKG_VERSION"),
    };
    origin.sign_files();
}
