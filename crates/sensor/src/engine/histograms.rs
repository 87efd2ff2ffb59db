//! Histograms of macropixels: one array, rows of bins.

use std::ops::{Index, IndexMut};
use std::slice::ChunksExact;

use super::EngineError;

/// Counts of macropixels, in the order they were asked for, and their bins, bin 0 earliest: shape (macropixels, bins), row
/// after row in one array.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Histograms {
    bins: usize,
    counts: Vec<u16>,
}

impl Histograms {
    /// No macropixels; `bins`, at least 1, are those of each to come.
    pub fn new(bins: usize) -> Self {
        Self::empty(0, bins)
    }

    /// So many macropixels without counts.
    pub fn empty(macropixels: usize, bins: usize) -> Self {
        debug_assert!(bins > 0, "a macropixel has a bin");
        Histograms {
            bins,
            counts: vec![0; macropixels * bins],
        }
    }

    /// Of macropixels whose counts come one after the other.
    ///
    /// # Panics
    /// As `Histograms::push`.
    pub fn from_rows(bins: usize, rows: impl IntoIterator<Item = impl AsRef<[u16]>>) -> Self {
        let mut histograms = Self::new(bins);
        for row in rows {
            histograms.push(row.as_ref());
        }
        histograms
    }

    /// Of parts, one after the other.
    ///
    /// # Panics
    /// As `Histograms::append`.
    pub fn joined(bins: usize, parts: impl IntoIterator<Item = Histograms>) -> Self {
        let mut all = Self::new(bins);
        for part in parts {
            all.append(&part);
        }
        all
    }

    /// Bins of a macropixel.
    pub fn bins(&self) -> usize {
        self.bins
    }

    /// Macropixels.
    pub fn len(&self) -> usize {
        self.counts.len() / self.bins
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Adds a macropixel.
    ///
    /// # Panics
    /// When it has other bins.
    pub(crate) fn push(&mut self, counts: &[u16]) {
        assert_eq!(counts.len(), self.bins, "bins of a macropixel");
        self.counts.extend_from_slice(counts);
    }

    /// Adds a macropixel whose counts are `None` where a bit of them is unknown.
    ///
    /// # Errors
    /// [`EngineError::Unknown`], with what `macropixel` says, of the first unknown one.
    ///
    /// # Panics
    /// As `Histograms::push`.
    pub(super) fn push_known(
        &mut self,
        counts: impl IntoIterator<Item = Option<u16>>,
        macropixel: impl Fn() -> String,
    ) -> Result<(), EngineError> {
        let known = |(bin, count): (usize, Option<u16>)| {
            let macropixel = &macropixel;
            count.ok_or_else(|| EngineError::Unknown {
                macropixel: macropixel(),
                bin,
            })
        };
        let counts = counts.into_iter().enumerate().map(known);
        self.push(&counts.collect::<Result<Vec<u16>, _>>()?);
        Ok(())
    }

    /// Adds macropixels.
    ///
    /// # Panics
    /// When they have other bins.
    pub(crate) fn append(&mut self, others: &Histograms) {
        assert_eq!(others.bins, self.bins, "bins of a macropixel");
        self.counts.extend_from_slice(&others.counts);
    }

    /// Counts of each macropixel.
    pub fn iter(&self) -> ChunksExact<'_, u16> {
        self.counts.chunks_exact(self.bins)
    }

    /// All counts, row after row.
    pub fn counts(&self) -> &[u16] {
        &self.counts
    }

    /// All counts, row after row.
    pub fn into_counts(self) -> Vec<u16> {
        self.counts
    }
}

impl Index<usize> for Histograms {
    type Output = [u16];

    /// Counts of a macropixel.
    fn index(&self, macropixel: usize) -> &[u16] {
        &self.counts[macropixel * self.bins..][..self.bins]
    }
}

impl IndexMut<usize> for Histograms {
    fn index_mut(&mut self, macropixel: usize) -> &mut [u16] {
        &mut self.counts[macropixel * self.bins..][..self.bins]
    }
}

impl<'a> IntoIterator for &'a Histograms {
    type Item = &'a [u16];
    type IntoIter = ChunksExact<'a, u16>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}
