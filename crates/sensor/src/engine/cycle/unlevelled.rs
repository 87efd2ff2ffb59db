//! Why a netlist is left to the gate engine: what each step from netlist to tape may refuse.

/// Why a netlist has no tape.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum LevelisationError {
    /// A net is X when the exposure starts.
    #[error("{0} is unknown when the exposure starts")]
    Unknown(String),
    /// A register of the stream starts with a value that its neighbours rule out.
    #[error("{0} does not start at 0")]
    Start(String),
    /// An edge arrives by paths of different length.
    #[error("edges reach {net} after {shortest_fs} to {longest_fs} fs")]
    Ambiguous {
        /// Where.
        net: String,
        /// Shortest path.
        shortest_fs: i64,
        /// Longest path.
        longest_fs: i64,
    },
    /// A lane did what the tape cannot tell the outcome of: two edges too close to call, or one round a loop.
    #[error("the next change of {0} is too close to call")]
    Trapped(String),
    /// A reset or set ends before what it does is done.
    #[error("the reset or set of {0} ends before what it does has settled")]
    Clear(String),
    /// Something the tapes have no operation for.
    #[error("{0} has no place on a tape")]
    Structure(String),
}
