//! Photons whose avalanches trigger others (afterpulses, crosstalk), and the rest: separate streams with their own
//! random numbers.

use crate::photon::random::Purpose;

/// Which photons of a macropixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// Those whose avalanches cause no others.
    Plain,
    /// Those whose avalanches do.
    Breeding,
}

impl Kind {
    pub(super) fn counts(self) -> Purpose {
        match self {
            Kind::Plain => Purpose::PhotonCounts,
            Kind::Breeding => Purpose::BreedingCounts,
        }
    }

    pub(super) fn background(self) -> Purpose {
        match self {
            Kind::Plain => Purpose::Photons,
            Kind::Breeding => Purpose::BreedingPhotons,
        }
    }

    pub(super) fn echo(self) -> Purpose {
        match self {
            Kind::Plain => Purpose::Signal,
            Kind::Breeding => Purpose::BreedingSignal,
        }
    }

    pub(super) fn bright_background(self) -> u32 {
        match self {
            Kind::Plain => Purpose::BrightPhotons as u32,
            Kind::Breeding => Purpose::BrightBreedingPhotons as u32,
        }
    }

    pub(super) fn bright_echo(self) -> u32 {
        match self {
            Kind::Plain => Purpose::BrightSignal as u32,
            Kind::Breeding => Purpose::BrightBreedingSignal as u32,
        }
    }
}
