//! Numbers by xorshift64* (S. Vigna, ACM Trans. Mathematical Software 42 (2016) 30): a run repeats by its seed.

pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        // Any seed but 0; spread, so that neighbours differ from the start.
        Self((seed + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1)
    }

    pub fn bits(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 8
    }

    /// 0..n.
    pub fn below(&mut self, n: u64) -> u64 {
        self.bits() % n
    }

    /// True once in n.
    pub fn once_in(&mut self, n: u64) -> bool {
        self.below(n) == 0
    }

    /// 0..1.
    pub fn share(&mut self) -> f64 {
        self.below(1 << 30) as f64 / f64::from(1 << 30)
    }

    pub fn one_of<T: Copy>(&mut self, choices: &[T]) -> T {
        choices[self.below(choices.len() as u64) as usize]
    }

    /// Any single, the odd ones more often than chance has them.
    pub fn single(&mut self) -> f32 {
        match self.below(8) {
            0 => self.one_of(&[
                0.0,
                -0.0,
                f32::NAN,
                f32::INFINITY,
                f32::NEG_INFINITY,
                f32::MAX,
                f32::MIN_POSITIVE,
                1e-45,
                -1.0,
                1e30,
            ]),
            1 | 2 => f32::from_bits(self.bits() as u32),
            _ => (self.share() * 2.0) as f32,
        }
    }
}
