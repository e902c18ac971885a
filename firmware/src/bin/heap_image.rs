//! Puts something on a heap, though on one that is always full: the check of images must see it.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
extern crate alloc;

/// A heap without memory.
#[cfg(target_os = "none")]
struct Full;

#[cfg(target_os = "none")]
#[allow(unsafe_code, reason = "an allocator is unsafe by its trait")]
// SAFETY: nothing is ever given out, so that nothing can be given out wrongly.
unsafe impl core::alloc::GlobalAlloc for Full {
    unsafe fn alloc(&self, _: core::alloc::Layout) -> *mut u8 {
        core::ptr::null_mut()
    }

    unsafe fn dealloc(&self, _: *mut u8, _: core::alloc::Layout) {}
}

#[cfg(target_os = "none")]
#[global_allocator]
static HEAP: Full = Full;

/// Start-up, a box, then samples for ever.
#[cfg(target_os = "none")]
#[cortex_m_rt::entry]
fn main() -> ! {
    let started = firmware::stm32f405::start();
    core::hint::black_box(alloc::boxed::Box::new(core::hint::black_box(1_u32)));
    firmware::run::run(started)
}

#[cfg(not(target_os = "none"))]
fn main() {}
