//! Log bytes on their way to a UART that is slower than whoever logs.

/// A ring of `N` bytes. Full means that new bytes are dropped: the log never waits.
#[derive(Debug)]
pub struct LogRing<const N: usize> {
    bytes: [u8; N],
    read: usize,
    length: usize,
}

impl<const N: usize> LogRing<N> {
    /// Empty.
    pub const fn new() -> Self {
        Self {
            bytes: [0; N],
            read: 0,
            length: 0,
        }
    }

    /// Adds a byte, or drops it.
    pub fn push(&mut self, byte: u8) {
        if self.length >= N {
            return;
        }
        let mut at = self.read + self.length;
        if at >= N {
            at -= N;
        }
        if let Some(place) = self.bytes.get_mut(at) {
            *place = byte;
            self.length += 1;
        }
    }

    /// Whether there is nothing in it.
    pub const fn is_empty(&self) -> bool {
        self.length == 0
    }

    /// Takes the oldest byte.
    pub fn pop(&mut self) -> Option<u8> {
        if self.length == 0 {
            return None;
        }
        let byte = self.bytes.get(self.read).copied();
        self.read += 1;
        if self.read >= N {
            self.read = 0;
        }
        self.length -= 1;
        byte
    }
}

impl<const N: usize> Default for LogRing<N> {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::LogRing;

    #[test]
    fn bytes_come_out_in_order_and_a_full_ring_drops_the_new_ones() {
        let mut ring = LogRing::<5>::new();
        for round in 0..20_u8 {
            for byte in 0..7 {
                ring.push(round.wrapping_mul(7).wrapping_add(byte));
            }
            for byte in 0..5 {
                assert_eq!(ring.pop(), Some(round.wrapping_mul(7).wrapping_add(byte)));
            }
            assert_eq!(ring.pop(), None);
            assert!(ring.is_empty());
            ring.push(1);
            assert!(!ring.is_empty());
            assert_eq!(ring.pop(), Some(1));
        }
    }
}
