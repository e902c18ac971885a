//! A link's port in memory: what a UART with its buffers is to a controller.

use std::collections::VecDeque;
use std::convert::Infallible;

use embedded_io::{ErrorType, Read, ReadReady, Write, WriteReady};

/// Bytes that have arrived, and bytes that wait to be sent, up to so many.
#[derive(Debug, Default)]
pub struct MemoryPort {
    /// What has arrived and was not read yet.
    pub incoming: VecDeque<u8>,
    /// What was written and is not on the wire yet.
    pub outgoing: VecDeque<u8>,
    /// Bytes that `outgoing` holds at most.
    pub capacity: usize,
}

impl MemoryPort {
    /// With room for so many bytes.
    #[must_use]
    pub fn new(capacity: usize) -> Self {
        Self {
            capacity,
            ..Self::default()
        }
    }

    fn room(&self) -> usize {
        self.capacity.saturating_sub(self.outgoing.len())
    }
}

impl ErrorType for MemoryPort {
    type Error = Infallible;
}

impl Read for MemoryPort {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        assert!(
            !self.incoming.is_empty(),
            "a port that is not ready would wait"
        );
        let count = buffer.len().min(self.incoming.len());
        for (place, byte) in buffer.iter_mut().zip(self.incoming.drain(..count)) {
            *place = byte;
        }
        Ok(count)
    }
}

impl ReadReady for MemoryPort {
    fn read_ready(&mut self) -> Result<bool, Infallible> {
        Ok(!self.incoming.is_empty())
    }
}

impl Write for MemoryPort {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        let count = bytes.len().min(self.room());
        assert!(count > 0, "a port that is not ready would wait");
        self.outgoing.extend(bytes.iter().take(count));
        Ok(count)
    }

    fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

impl WriteReady for MemoryPort {
    fn write_ready(&mut self) -> Result<bool, Infallible> {
        Ok(self.room() > 0)
    }
}
