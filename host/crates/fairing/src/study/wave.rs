//! A smooth function whose derivatives are known: a sum of two plane waves.

/// `sin(a·x + 0.4) + ½ cos(b·x)`, plus a linear function.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wave {
    /// The first wave's direction, in radians for each unit of length.
    pub a: [f64; 2],
    /// The second wave's.
    pub b: [f64; 2],
    /// How strong the waves are.
    pub strength: f64,
    /// The gradient of the linear function.
    pub slope: [f64; 2],
}

impl Wave {
    /// One and a half waves across the unit square.
    pub const STUDY: Self = Self { a: [4.0, 2.0], b: [5.0, -3.0], strength: 1.0, slope: [0.0; 2] };

    fn phases(&self, p: [f64; 2]) -> [f64; 2] {
        [self.a, self.b].map(|k| k[0] * p[0] + k[1] * p[1])
    }

    /// u.
    pub fn value(&self, p: [f64; 2]) -> f64 {
        self.laplacian_power(p, 0) + self.slope[0] * p[0] + self.slope[1] * p[1]
    }

    /// ∇u.
    pub fn gradient(&self, p: [f64; 2]) -> [f64; 2] {
        let [s, t] = self.phases(p);
        let (first, second) = (self.strength * (s + 0.4).cos(), -0.5 * self.strength * t.sin());
        std::array::from_fn(|k| first * self.a[k] + second * self.b[k] + self.slope[k])
    }

    /// Δᵏ of the waves; for k > 0 that of u.
    pub fn laplacian_power(&self, p: [f64; 2], power: i32) -> f64 {
        let [s, t] = self.phases(p);
        let factor = |k: [f64; 2]| (-(k[0] * k[0] + k[1] * k[1])).powi(power);
        self.strength * (factor(self.a) * (s + 0.4).sin() + 0.5 * factor(self.b) * t.cos())
    }
}
