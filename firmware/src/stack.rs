//! How deep the stack has been: it is painted before `main`, and paint that is gone was used.

use cortex_m_rt::STACK_PAINT_VALUE;

/// Bytes at the end of the stack that are out of bounds: the largest frame of an exception and what a handler's first
/// push takes come to lie in them, not beyond.
pub const GUARD_BYTES: usize = 512;

/// Deepest use so far in bytes.
#[allow(
    unsafe_code,
    reason = "reads the stack's paint between two symbols of the linker"
)]
pub fn used_bytes() -> u32 {
    unsafe extern "C" {
        static _stack_start: u32;
        static _stack_end: u32;
    }
    let top = &raw const _stack_start;
    // What is out of bounds was not used.
    let mut at = (&raw const _stack_end).wrapping_byte_add(GUARD_BYTES);
    // SAFETY: both symbols bound the stack's region (board.x), which is all readable memory; volatile because
    // this function's own frame lies in it.
    while at < top && unsafe { at.read_volatile() } == STACK_PAINT_VALUE {
        at = at.wrapping_add(1);
    }
    (top as u32).wrapping_sub(at as u32)
}
