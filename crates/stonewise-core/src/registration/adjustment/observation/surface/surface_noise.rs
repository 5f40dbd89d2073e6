//! The noise model of a stone's points.

/// Noise of the points and roughness of the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SurfaceNoise {
    /// Standard deviation of a point along the normal, per epoch, metres.
    pub sigma_m: [f64; 2],
    /// Standard deviation of a second difference of the coefficients, metres.
    pub tau_m: f64,
}

impl SurfaceNoise {
    /// The noise of a stone whose points have these factors on it, per epoch.
    pub fn of_stone(&self, factors: &[f64; 2]) -> Self {
        Self {
            sigma_m: [0, 1].map(|e| factors[e] * self.sigma_m[e]),
            ..*self
        }
    }
}
