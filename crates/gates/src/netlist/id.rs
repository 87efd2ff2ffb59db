//! Numbers of nets, cells and instances in an elaborated chip: each indexes an array of [`Netlist`](super::Netlist).

use std::num::NonZeroU32;

macro_rules! id {
    ($(#[$doc:meta])* $name:ident) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub struct $name(
            // One more than its index, so that an `Option` of it takes no more memory.
            NonZeroU32,
        );

        impl $name {
            /// From an index.
            #[inline]
            pub const fn new(index: usize) -> Self {
                $name(NonZeroU32::MIN.saturating_add(index as u32))
            }

            /// Index into the array.
            #[inline]
            pub const fn index(self) -> usize {
                (self.0.get() - 1) as usize
            }
        }
    };
}

id! {
    /// A net of the elaborated chip, among as many as [`Netlist::net_count`](super::Netlist::net_count) says.
    NetId
}

id! {
    /// A leaf cell of the elaborated chip, one of [`Netlist::cells`](super::Netlist::cells).
    CellId
}

id! {
    /// An instance in the hierarchy, one of [`Netlist::scopes`](super::Netlist::scopes).
    ScopeId
}

impl ScopeId {
    /// The whole chip.
    pub const TOP: ScopeId = ScopeId::new(0);
}
