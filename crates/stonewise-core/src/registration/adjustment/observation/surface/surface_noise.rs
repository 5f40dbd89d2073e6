//! The noise model of a stone's points.

/// Noise of the points and roughness of the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SurfaceNoise {
    /// Standard deviation of a point along the normal, per epoch, metres.
    pub sigma_m: [f64; 2],
    /// Standard deviation of a second difference of the coefficients, metres.
    pub tau_m: f64,
}

/// How a stone's noise departs from that of most stones, as factors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct NoiseFactors {
    /// Factors on the noise of the points, per epoch.
    pub points: [f64; 2],
    /// Factor on the surface's roughness.
    pub roughness: f64,
}

impl NoiseFactors {
    /// The factors of most stones.
    pub const USUAL: Self = Self {
        points: [1.0; 2],
        roughness: 1.0,
    };
}

impl SurfaceNoise {
    /// The noise of a stone.
    pub fn of_stone(&self, factors: &NoiseFactors) -> Self {
        Self {
            sigma_m: [0, 1].map(|e| factors.points[e] * self.sigma_m[e]),
            ..self.on_surface(factors.roughness)
        }
    }

    /// The noise on a surface whose roughness is this factor times the usual one.
    pub fn on_surface(&self, roughness: f64) -> Self {
        Self {
            tau_m: roughness * self.tau_m,
            ..*self
        }
    }
}
