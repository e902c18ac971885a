//! The article's filter in matrix notation.

use nalgebra::{Matrix2, RowVector2, Vector2};

use super::peers_law::linearised;

pub struct Memory {
    x: Vector2<f32>,
    p: Matrix2<f32>,
}

pub fn start() -> Memory {
    Memory {
        x: Vector2::new(0.6, 0.2),
        p: Matrix2::new(0.36, 0.0, 0.0, 0.04),
    }
}

#[inline(never)]
#[unsafe(no_mangle)]
pub fn update(memory: &mut Memory, slip: f32, friction: f32) {
    let at = linearised(memory.x.into(), &memory.p, slip);
    let [h0, h1] = at.gradient;
    let h = RowVector2::new(h0, h1);
    let pht = memory.p * h.transpose();
    let k = pht / ((h * pht)[0] + at.variance);
    memory.x += k * (friction - at.friction);
    memory.p = (Matrix2::identity() - k * h) * memory.p;
}

pub fn answer(memory: &Memory) -> [f32; 2] {
    memory.x.into()
}
