//! What can be wrong with a circuit description.

/// What is wrong with a circuit description.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NetlistError {
    /// Two outputs drive one net.
    #[error(
        "module {module}: net {net} has two drivers, {first} and {second}; give each its own net"
    )]
    DriverConflict {
        /// Module at fault.
        module: String,
        /// Net driven twice.
        net: String,
        /// First driver.
        first: String,
        /// Second driver.
        second: String,
    },
    /// Nothing drives a net.
    #[error("module {module}: nothing drives net {net}; connect an output to it or remove it")]
    Undriven {
        /// Module at fault.
        module: String,
        /// Net without a driver.
        net: String,
    },
    /// A cell or port got the wrong number of nets.
    #[error("module {module}: {what} takes {wanted} nets and got {got}")]
    WidthMismatch {
        /// Module at fault.
        module: String,
        /// Cell pin list or port.
        what: String,
        /// Nets it takes.
        wanted: usize,
        /// Nets it got.
        got: usize,
    },
    /// An instance names a port that its module does not have.
    #[error("module {module}: instance {instance} has no port {port}")]
    NoPort {
        /// Module at fault.
        module: String,
        /// Instance at fault.
        instance: String,
        /// Name of the port.
        port: String,
    },
    /// An instance leaves an input open.
    #[error("module {module}: instance {instance} leaves open input port {port}")]
    OpenInput {
        /// Module at fault.
        module: String,
        /// Instance at fault.
        instance: String,
        /// Name of the port.
        port: String,
    },
    /// Two things of the same name in one module.
    #[error("module {module}: the name {name} is used twice")]
    DuplicateName {
        /// Module at fault.
        module: String,
        /// Name used twice.
        name: String,
    },
    /// A name that Verilog or VCD readers would not take.
    #[error("module {module}: {name:?} is not an identifier; use letters, digits and underscores")]
    BadName {
        /// Module at fault.
        module: String,
        /// The name.
        name: String,
    },
}
