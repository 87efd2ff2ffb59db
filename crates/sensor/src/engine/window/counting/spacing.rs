//! How far apart a SPAD's two photons are, in rows.

/// What the rows of a SPAD's only two photons tell, neither of which is doubtful.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spacing {
    /// Rows of bins, 1 to this.
    pub bins: usize,
    /// Farther apart than the SPADs' memory, if by more.
    pub far: usize,
    /// Closer than it, if by less and both in bins.
    pub blind: usize,
}

impl Spacing {
    /// Whether both make pulses as far as anybody can see: nothing is counted outside the window, and photons far apart do
    /// not meet. `first` is the lower row.
    #[inline(always)]
    pub(super) fn both_fire(&self, first: usize, second: usize) -> bool {
        (second == 0) | (first > self.bins) | ((first > 0) & (second - first > self.far))
    }

    /// Whether the photon in the `second` row meets the blindness that the `first` one leaves, the lower row.
    #[inline(always)]
    pub(super) fn one_fires(&self, first: usize, second: usize) -> bool {
        let apart = second - first;
        (first > 0) & (second <= self.bins) & (apart > 0) & (apart < self.blind)
    }
}
