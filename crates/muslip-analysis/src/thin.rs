//! A bounded, even selection of a stream of unknown length.

/// Keeps every `stride`-th item of a stream; whenever the store is full, every second one is let go and
/// the stride doubles. So at least half the capacity is in use, evenly spread, the same for the same
/// stream.
#[derive(Debug, Clone)]
pub struct Thinned<T> {
    items: Vec<T>,
    capacity: usize,
    stride: u64,
    seen: u64,
}

impl<T> Thinned<T> {
    /// An empty selection of at most `capacity` items (at least two).
    pub fn new(capacity: usize) -> Self {
        Self {
            items: Vec::new(),
            capacity: capacity.max(2),
            stride: 1,
            seen: 0,
        }
    }

    /// Offers the next item; `make` is only called when the item is kept.
    pub fn offer(&mut self, make: impl FnOnce() -> T) {
        if self.seen.is_multiple_of(self.stride) {
            if self.items.len() == self.capacity {
                let mut index = 0;
                self.items.retain(|_| {
                    index += 1;
                    index % 2 == 1
                });
                self.stride *= 2;
            }
            if self.seen.is_multiple_of(self.stride) {
                self.items.push(make());
            }
        }
        self.seen += 1;
    }

    /// Number of items offered so far.
    pub fn seen(&self) -> u64 {
        self.seen
    }

    /// One of how many items is kept.
    pub fn stride(&self) -> u64 {
        self.stride
    }

    /// What was kept, in the order of the stream.
    pub fn items(&self) -> &[T] {
        &self.items
    }

    /// What was kept, in the order of the stream.
    pub fn into_items(self) -> Vec<T> {
        self.items
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_short_stream_is_kept_whole_and_a_long_one_evenly() {
        for length in [5u64, 8, 9, 100, 1000] {
            let mut thinned = Thinned::new(8);
            for item in 0..length {
                thinned.offer(|| item);
            }
            let kept = thinned.items();
            assert!(
                kept.len() <= 8 && kept.len() as u64 >= length.min(4),
                "{kept:?}"
            );
            let stride = kept[1] - kept[0];
            assert!(
                kept.windows(2).all(|pair| pair[1] - pair[0] == stride),
                "{kept:?}"
            );
            assert!(
                kept[0] == 0 && kept[kept.len() - 1] + stride >= length,
                "{kept:?}"
            );
        }
    }
}
