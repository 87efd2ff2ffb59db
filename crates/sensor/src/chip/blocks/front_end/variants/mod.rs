//! The list of front ends, one file each.

pub(super) mod coincidence;
pub(super) mod or_tree;
pub mod summation;
pub(in crate::chip::blocks) mod xor_tree;

variants! {
    /// How the pulses of a macropixel's SPADs become SPAD_TIMED (thesis 2.4.1, Fig. 22).
    pub enum FrontEnd {
        /// A toggle flip-flop and two samplers for each SPAD, whose events the correlation block sums up (Fig. 22d). Two pulses
        /// of one SPAD in a CLK period are lost.
        summation: Summation = "summation",
        /// Pulse shapers and an OR tree (Fig. 22a). Pulses that overlap are lost, and two that are sampled together.
        or_tree: OrTree = "or_tree",
        /// Toggle flip-flops and an XOR tree (Fig. 22b). Two pulses in a CLK period are lost.
        xor_tree: XorTree = "xor_tree",
        /// Pulse shapers, and an event where `coincident_spads` SPADs fire within a shaped pulse (Fig. 22c). What
        /// does not coincide is lost.
        coincidence: Coincidence = "coincidence",
    }
}
