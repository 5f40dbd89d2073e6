//! Brown's distortion terms and the radius up to which they can be inverted.

/// Radial, rational and tangential distortion (Brown 1971; rational terms as in OpenCV).
///
/// With r^2 = x^2 + y^2: s = (1 + k1 r^2 + k2 r^4 + k3 r^6 + k4 r^8) / (1 + d1 r^2 + d2 r^4 + d3 r^6), x' = s
/// x + 2 p1 x y + p2 (r^2 + 2 x^2), y' = s y + p1 (r^2 + 2 y^2) + 2 p2 x y. OpenCV's k1, k2, k3 are
/// `radial[..3]` and its k4, k5, k6 are `rational`; Metashape's k4 is `radial[3]` and its (p1, p2) are
/// `tangential` in reverse order.
#[derive(Clone, Debug, PartialEq)]
pub struct Brown {
    radial: [f64; 4],
    rational: [f64; 3],
    tangential: [f64; 2],
    max_radius: f64,
}

impl Brown {
    /// The terms, and the largest radius at or below `limit` where the image does not fold over.
    ///
    /// A polynomial fitted inside the photo turns back somewhere outside it, and a point there would land in
    /// the photo again. Cost: some 10^5 operations, once per camera.
    pub fn new(radial: [f64; 4], rational: [f64; 3], tangential: [f64; 2], limit: f64) -> Self {
        let mut brown = Self {
            radial,
            rational,
            tangential,
            max_radius: limit,
        };
        brown.max_radius = brown.fold_radius(limit);
        brown
    }

    /// k1..k4.
    pub fn radial(&self) -> [f64; 4] {
        self.radial
    }

    /// Coefficients of the denominator.
    pub fn rational(&self) -> [f64; 3] {
        self.rational
    }

    /// (p1, p2) in OpenCV's order.
    pub fn tangential(&self) -> [f64; 2] {
        self.tangential
    }

    /// Undistorted radius at which the range of the model ends.
    pub fn max_radius(&self) -> f64 {
        self.max_radius
    }

    /// The distorted place; `None` beyond [`Brown::max_radius`].
    #[inline(always)]
    pub fn distort(&self, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
        let r2 = x * x + y * y;
        // Written so that a NaN is refused as well.
        (r2 <= self.max_radius * self.max_radius).then(|| self.evaluate(x, y, r2))
    }

    /// The undistorted place, to 1e-12 of a focal length; `None` where no ray within range comes from.
    ///
    /// A safeguarded search along the radius, then Newton's method for the tangential terms.
    pub fn undistort(&self, [xd, yd]: [f64; 2]) -> Option<[f64; 2]> {
        let rd = xd.hypot(yd);
        if !rd.is_finite() {
            return None;
        }
        if rd == 0.0 && self.tangential == [0.0; 2] {
            return Some([0.0; 2]);
        }
        let scale = if rd > 0.0 {
            self.invert_radius(rd) / rd
        } else {
            0.0
        };
        let (mut x, mut y) = (xd * scale, yd * scale);

        for _ in 0..NEWTON_STEPS {
            let ([fx, fy], [a, b, d]) = self.with_jacobian(x, y);
            let (ex, ey) = (fx - xd, fy - yd);
            let det = a * d - b * b;
            if det.is_nan() || det.abs() <= 1e-12 {
                return None;
            }
            let (dx, dy) = ((d * ex - b * ey) / det, (a * ey - b * ex) / det);
            x -= dx;
            y -= dy;
            if dx.hypot(dy) <= 1e-15 * (1.0 + x.hypot(y)) {
                break;
            }
        }

        let [fx, fy] = self.evaluate(x, y, x * x + y * y);
        let converged = (fx - xd).hypot(fy - yd) <= 1e-12 * (1.0 + rd);
        // The tolerance lets a ray at the very edge of the range pass through and back.
        (converged && x.hypot(y) <= self.max_radius * (1.0 + 1e-12)).then_some([x, y])
    }

    #[inline(always)]
    fn evaluate(&self, x: f64, y: f64, r2: f64) -> [f64; 2] {
        let [k1, k2, k3, k4] = self.radial;
        let [d1, d2, d3] = self.rational;
        let [p1, p2] = self.tangential;
        let n = 1.0 + r2 * (k1 + r2 * (k2 + r2 * (k3 + r2 * k4)));
        let s = n / (1.0 + r2 * (d1 + r2 * (d2 + r2 * d3)));
        let xy2 = 2.0 * x * y;
        [
            x * s + p1 * xy2 + p2 * (r2 + 2.0 * x * x),
            y * s + p1 * (r2 + 2.0 * y * y) + p2 * xy2,
        ]
    }

    /// Radial factor and its derivative by r^2; the factor is NaN where the denominator is not positive.
    fn factor(&self, r2: f64) -> (f64, f64) {
        let [k1, k2, k3, k4] = self.radial;
        let [d1, d2, d3] = self.rational;
        let n = 1.0 + r2 * (k1 + r2 * (k2 + r2 * (k3 + r2 * k4)));
        let dn = k1 + r2 * (2.0 * k2 + r2 * (3.0 * k3 + r2 * 4.0 * k4));
        let d = 1.0 + r2 * (d1 + r2 * (d2 + r2 * d3));
        let dd = d1 + r2 * (2.0 * d2 + r2 * 3.0 * d3);
        if d > 0.0 {
            (n / d, (dn * d - n * dd) / (d * d))
        } else {
            (f64::NAN, f64::NAN)
        }
    }

    /// The distorted place and the symmetric Jacobian (dx'/dx, dx'/dy, dy'/dy).
    fn with_jacobian(&self, x: f64, y: f64) -> ([f64; 2], [f64; 3]) {
        let r2 = x * x + y * y;
        let [p1, p2] = self.tangential;
        let (s, ds) = self.factor(r2);
        let jacobian = [
            s + 2.0 * x * x * ds + 2.0 * p1 * y + 6.0 * p2 * x,
            2.0 * x * y * ds + 2.0 * p1 * x + 2.0 * p2 * y,
            s + 2.0 * y * y * ds + 6.0 * p1 * y + 2.0 * p2 * x,
        ];
        (self.evaluate(x, y, r2), jacobian)
    }

    /// Undistorted radius of a distorted one, without tangential terms; the end of the range where it lies
    /// beyond.
    fn invert_radius(&self, rd: f64) -> f64 {
        let (mut low, mut high) = (0.0, self.max_radius);
        let mut r = rd.min(high);
        for i in 0..NEWTON_STEPS {
            let (s, ds) = self.factor(r * r);
            let error = r * s - rd;
            if error.abs() <= 1e-9 * (1.0 + rd) {
                break;
            }
            if error > 0.0 {
                high = r;
            } else {
                low = r;
            }
            let newton = r - error / (s + 2.0 * r * r * ds);
            // Near a pole of the rational terms Newton's steps are tiny, so every third halves the bracket.
            r = if i % 3 < 2 && newton > low && newton < high {
                newton
            } else {
                0.5 * (low + high)
            };
        }
        r
    }

    /// First radius, in any of several directions, where the Jacobian's determinant is not positive.
    fn fold_radius(&self, limit: f64) -> f64 {
        let is_valid = |r: f64, (cos, sin): (f64, f64)| {
            let (_, [a, b, d]) = self.with_jacobian(r * cos, r * sin);
            a * d - b * b > 0.0 && a + d > 0.0
        };
        let directions: Vec<_> = (0..FOLD_DIRECTIONS)
            .map(|i| (f64::from(i) * std::f64::consts::TAU / f64::from(FOLD_DIRECTIONS)).sin_cos())
            .map(|(sin, cos)| (cos, sin))
            .collect();
        let angle_step = limit.atan() / f64::from(FOLD_STEPS);
        let mut last_valid = 0.0;
        for i in 1..=FOLD_STEPS {
            let r = (f64::from(i) * angle_step).tan().min(limit);
            if !directions.iter().all(|&direction| is_valid(r, direction)) {
                let (mut low, mut high) = (last_valid, r);
                for _ in 0..60 {
                    let middle = 0.5 * (low + high);
                    if directions.iter().all(|&direction| is_valid(middle, direction)) {
                        low = middle;
                    } else {
                        high = middle;
                    }
                }
                return low;
            }
            last_valid = r;
        }
        limit
    }
}

const NEWTON_STEPS: usize = 60;
const FOLD_DIRECTIONS: u32 = 16;
const FOLD_STEPS: u32 = 1500;
