//! `heapless`'s single-producer queue without its one panic: both ends divide by a length that they read at
//! run time, and the compiler cannot know that it is not zero.

use core::hint::assert_unchecked;

use heapless::spsc::{Consumer, Producer, Queue};

/// The end that fills.
pub struct Sender<T: 'static>(Producer<'static, T>);

/// The end that empties.
pub struct Taker<T: 'static>(Consumer<'static, T>);

/// Parts a queue that lives for ever.
pub fn split<T, const N: usize>(queue: &'static mut Queue<T, N>) -> (Sender<T>, Taker<T>) {
    const { assert!(N > 1) };
    let (producer, consumer) = queue.split();
    (Sender(producer), Taker(consumer))
}

/// Says that a capacity is that of a queue made by [`split`].
fn has_room_for_one(capacity: usize) {
    #[allow(
        unsafe_code,
        reason = "tells the compiler a capacity that it cannot see"
    )]
    // SAFETY: the capacity is N - 1 with N > 1, checked where the queue was parted.
    unsafe {
        assert_unchecked(capacity != usize::MAX);
    }
}

impl<T> Sender<T> {
    /// Adds an item; whether there was room.
    #[inline]
    pub fn push(&mut self, item: T) -> bool {
        has_room_for_one(self.0.capacity());
        self.0.enqueue(item).is_ok()
    }

    /// Items that would still go in.
    #[inline]
    pub fn room(&self) -> usize {
        has_room_for_one(self.0.capacity());
        self.0.capacity() - self.0.len()
    }

    /// Whether the other end has taken everything.
    #[inline]
    pub fn is_empty(&self) -> bool {
        has_room_for_one(self.0.capacity());
        self.0.is_empty()
    }
}

impl<T> Taker<T> {
    /// Takes the oldest item.
    #[inline]
    pub fn pop(&mut self) -> Option<T> {
        has_room_for_one(self.0.capacity());
        self.0.dequeue()
    }

    /// Whether there is an item.
    #[inline]
    pub fn ready(&self) -> bool {
        self.0.ready()
    }
}
