//! The list of P-counters, one file each.

pub(super) mod comparator;
pub(super) mod gray;
pub(super) mod memoryless;
pub(super) mod ripple;
pub(super) mod segmented;
pub(super) mod set_reset;
pub(super) mod synchronous;

variants! {
    /// How the P-counter is built (thesis 4.4). All have the same pins. Those with a memory open the same time windows where the
    /// counter holds after LOCAL_STOP. Where it wraps, LOCAL_STOP comes again after 2ⁿ⁺¹ counts of a counter of n bits with
    /// its borrow, and after 2ⁿ of one without: of the comparator, and of all with the tap `msb`.
    #[non_exhaustive]
    pub enum PCounter {
        /// Ripple down counter of reset-only flip-flops, Q or Q̄ chosen by the memory bit (Fig. 51c, 53).
        ripple: Ripple = "ripple",
        /// Ripple down counter of set/reset flip-flops and a delayed reset (Fig. 51b), the HSLIDAR's (4.9.2).
        set_reset: SetReset = "set_reset",
        /// Synchronous down counter (Fig. 50a).
        synchronous: Synchronous = "synchronous",
        /// Up counter from zero and a comparator (Fig. 49a).
        comparator: Comparator = "comparator",
        /// Ripple down counter without memory, loaded once, never reset: it comes round with STOP (4.4.3).
        memoryless: Memoryless = "memoryless",
        /// Synchronous down counter in Gray code, of which one bit changes with each count.
        gray: Gray = "gray",
        /// Down counter of three-bit segments: synchronous within a segment, a ripple from one to the next.
        segmented: Segmented = "segmented",
    }
}
