//! A set of faults, a bit each.

use muslip_record::Fault;

/// A set of faults.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct FaultSet(u32);

impl FaultSet {
    /// Adds a fault where a condition holds.
    pub fn add_if(&mut self, holds: bool, fault: Fault) {
        if holds {
            self.0 |= 1 << fault as u8;
        }
    }

    /// Takes a fault out.
    pub fn without(self, fault: Fault) -> Self {
        Self(self.0 & !(1 << fault as u8))
    }

    /// Whether a fault is in it.
    pub fn contains(self, fault: Fault) -> bool {
        self.0 & (1 << fault as u8) != 0
    }

    /// The fault that is named first.
    pub fn first(self) -> Option<Fault> {
        Fault::ALL.into_iter().find(|&fault| self.contains(fault))
    }

    /// One bit for each fault.
    pub fn bits(self) -> u32 {
        self.0
    }
}
