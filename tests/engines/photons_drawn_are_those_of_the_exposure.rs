//! The window engine counts each photon that it draws once, and none that comes after the exposure.

use guided_dtof::chip::{Exposure, SensorConfig};
use guided_dtof::engine::{Expose, LitPixel, Window, full_stream, stream_config};
use guided_dtof::photon::{PhotonStream, PixelLight};
use guided_dtof::units::Time;
use proptest::prelude::*;

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, ..ProptestConfig::default() })]

    /// Photons are drawn in groups of laser cycles, of which the last reaches beyond the exposure: what comes there is no photon of it.
    /// In little light, and in cycles longer than a window with the dead time before it, none is drawn for two windows.
    #[test]
    fn no_more_photons_are_drawn_than_there_are(
        laser_cycles in 1u32..5000,
        start in 40u16..300,
        seed: u64,
        signal in 0f64..1.0,
        background_hz in 0f64..2e5,
        thinned: bool,
    ) {
        let config = SensorConfig::default();
        let exposure = Exposure::new(&config, 400, laser_cycles);
        let stream = stream_config(&config, &exposure, seed, Time::from_ps(1_900));
        let arrival = config.clock().periods(i64::from(start) - 8);
        let mut light = PixelLight::echo(signal, arrival).with_background(background_hz);
        if thinned {
            let dimmer = PixelLight::echo(0.5 * signal, arrival).with_background(background_hz);
            light = PixelLight::timeline([(0, light), (1 + laser_cycles / 3, dimmer)]).unwrap();
        }
        let pixels = [LitPixel { number: 3, start, light: Some(light) }];
        let window = Window::new(&config, &exposure);
        let stream = PhotonStream::new(&stream);
        let seen = window.expose(&stream, &pixels).unwrap();
        let all = full_stream(&window, &stream, &pixels).unwrap();
        prop_assert_eq!(seen.histograms, all.histograms);
        let (some, every) = (seen.work.photons_drawn, all.work.photons_drawn);
        prop_assert!(some <= every, "{} drawn of {} photons", some, every);
    }
}
