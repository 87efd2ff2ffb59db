//! The circuits of the chip, one file for each block of its diagram (thesis Fig. 46 to 59), each beside its plain-Rust
//! reference model.

/// Declares the variants of a block, each with its file beside the list. For what their rows need more than the list does,
/// `rows!` gives these to the block: `VARIANT` of each file, in order.
macro_rules! variants {
    (
        $(#[$of:meta])*
        pub enum $name:ident {
            $($(#[$each:meta])* $file:ident: $variant:ident = $word:literal,)+
        }
    ) => {
        crate::settings::words! {
            $(#[$of])*
            pub enum $name {
                $($(#[$each])* $variant = $word,)+
            }
        }

        macro_rules! rows {
            () => { [$(&variants::$file::VARIANT),+] };
        }
        pub(super) use rows;
    };
}

pub mod array;
pub mod correlation;
pub mod front_end;
pub mod histogram;
pub mod histogram_sums;
pub mod load_path;
pub mod macropixel;
pub mod macropixel_model;
pub mod metdc;
pub mod metdc_counter;
pub mod metdc_delay_line;
pub mod p_counter;
pub mod p_counter_timing;
pub mod photon_line;
pub mod readout;
pub mod tdc;

use std::sync::Arc;

use crate::netlist::{Module, NetlistError};

/// Unwraps a circuit of this crate, whose correctness is ours to guarantee.
fn finished(module: Result<Arc<Module>, NetlistError>) -> Arc<Module> {
    module.unwrap_or_else(|error| panic!("a circuit of this crate is malformed: {error}"))
}
