//! How the mason laid the stones: rough courses, stones that span two, thin ones in pairs, corners knocked
//! off.

use crate::world::noise::normal;
use crate::world::wall_params::WallParams;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// A convex outline in layout coordinates (face coordinates before the courses are made wavy), metres.
#[derive(Clone, Debug, PartialEq)]
pub struct Outline {
    /// Sides as unit outward normal and offset: inside where `x*nx + y*ny <= c` for all.
    sides: Vec<[f64; 3]>,
    /// Corner radius, metres.
    corner_m: f64,
    /// Smallest x, largest x, smallest y, largest y.
    bounds: [f64; 4],
}

impl Outline {
    fn new(corners: &[[f64; 2]], shrink_m: f64, corner_m: f64) -> Self {
        let mut sides = Vec::with_capacity(corners.len());
        let mut bounds = [f64::MAX, f64::MIN, f64::MAX, f64::MIN];
        for (i, p) in corners.iter().enumerate() {
            let q = corners[(i + 1) % corners.len()];
            let (dx, dy) = (q[0] - p[0], q[1] - p[1]);
            let length = dx.hypot(dy);
            if length > 1e-6 {
                let (nx, ny) = (dy / length, -dx / length);
                sides.push([nx, ny, nx * p[0] + ny * p[1] - shrink_m]);
            }
            bounds = [
                bounds[0].min(p[0]),
                bounds[1].max(p[0]),
                bounds[2].min(p[1]),
                bounds[3].max(p[1]),
            ];
        }
        Self {
            sides,
            corner_m,
            bounds,
        }
    }

    /// Distance to the rounded outline, metres, negative inside; exact along the sides.
    pub fn distance(&self, x: f64, y: f64) -> f64 {
        let depth = |s: &[f64; 3]| s[0] * x + s[1] * y - s[2];
        let r = self.corner_m;
        // The outline moved in by the corner radius, then out again: corners become arcs.
        let (mut first, mut second) = (f64::MIN, f64::MIN);
        for d in self.sides.iter().map(|s| depth(s) + r) {
            if d > first {
                (first, second) = (d, first);
            } else if d > second {
                second = d;
            }
        }
        if second > 0.0 {
            (first * first + second * second).sqrt() - r
        } else {
            first - r
        }
    }

    /// Smallest x, largest x, smallest y, largest y of the outline before rounding, layout coordinates.
    pub fn bounds(&self) -> [f64; 4] {
        self.bounds
    }
}

/// Outlines of all stones of a wall, course by course from below, left to right.
pub fn lay_stones(params: &WallParams, rng: &mut ChaCha8Rng) -> Vec<Outline> {
    let half = params.width_m / 2.0;
    let courses = course_lines(params, rng);
    let mut laid = Laid::default();
    for (r, rise) in courses.windows(2).enumerate() {
        let (low, high) = (rise[0], rise[1]);
        let above = courses.get(r + 2).copied();
        let taken = std::mem::take(&mut laid.taken_above);
        for gap in free_intervals(&taken, -half, half) {
            fill(&gap, [low, high], above, params, rng, &mut laid);
        }
    }
    laid.outlines
}

/// The stones laid so far.
#[derive(Default)]
struct Laid {
    outlines: Vec<Outline>,
    /// Stretches of the next course that stones of this one take.
    taken_above: Vec<[f64; 2]>,
}

/// Heights of the bed joints, from the foot to the crown.
fn course_lines(params: &WallParams, rng: &mut ChaCha8Rng) -> Vec<f64> {
    let total = params.height_m + params.foot_m;
    let mut lines = vec![0.0];
    let mut top = 0.0;
    while top < total {
        top += params.course_m * (0.28 * normal(rng)).exp().clamp(0.55, 1.7);
        lines.push(top);
    }
    lines.iter().map(|l| l * total / top - params.foot_m).collect()
}

fn free_intervals(taken: &[[f64; 2]], from: f64, to: f64) -> Vec<[f64; 2]> {
    let mut free = Vec::new();
    let mut start = from;
    for t in taken {
        if t[0] > start + 1e-9 {
            free.push([start, t[0]]);
        }
        start = t[1];
    }
    if to > start + 1e-9 {
        free.push([start, to]);
    }
    free
}

/// Lays stones into one free stretch of a course; a stone may grow into the course above.
fn fill(
    stretch: &[f64; 2],
    rise: [f64; 2],
    above: Option<f64>,
    params: &WallParams,
    rng: &mut ChaCha8Rng,
    laid: &mut Laid,
) {
    let height = rise[1] - rise[0];
    let cuts = head_joints(stretch, height, params, rng);
    let mut left_slant = 0.0;

    for (k, pair) in cuts.windows(2).enumerate() {
        let (x0, x1) = (pair[0], pair[1]);
        let last = k + 2 == cuts.len();
        let tall = above
            .filter(|_| rng.random_bool(params.tall_share) && x1 - x0 > 0.6 * height && left_slant == 0.0);
        let right_slant = if last || tall.is_some() {
            0.0
        } else {
            0.16 * height * normal(rng).clamp(-1.5, 1.5)
        };
        let top = tall.unwrap_or(rise[1]);
        if tall.is_some() {
            laid.taken_above.push([x0, x1]);
        }
        let quad = [
            [x0 - left_slant, rise[0]],
            [x1 - right_slant, rise[0]],
            [x1 + right_slant, top],
            [x0 + left_slant, top],
        ];
        if tall.is_none() && height > 0.9 * params.course_m && rng.random_bool(params.split_share) {
            split(&quad, params, rng, &mut laid.outlines);
        } else {
            laid.outlines.push(cut_stone(&quad, params, rng));
        }
        left_slant = right_slant;
    }
}

/// Places of the head joints of a stretch, both ends included.
fn head_joints(stretch: &[f64; 2], height: f64, params: &WallParams, rng: &mut ChaCha8Rng) -> Vec<f64> {
    let length = stretch[1] - stretch[0];
    let mut widths = Vec::new();
    let mut sum = 0.0;
    while sum < length {
        let w = height * params.aspect * (0.38 * normal(rng)).exp().clamp(0.45, 2.2);
        if sum + 0.5 * w > length && !widths.is_empty() {
            break;
        }
        sum += w;
        widths.push(w);
    }
    let mut x = stretch[0];
    let mut cuts = vec![x];
    for w in &widths {
        x += w * length / sum;
        cuts.push(x);
    }
    cuts
}

/// Two thin stones, one on the other, in the place of one.
fn split(quad: &[[f64; 2]; 4], params: &WallParams, rng: &mut ChaCha8Rng, outlines: &mut Vec<Outline>) {
    let along = |p: [f64; 2], q: [f64; 2], t: f64| [p[0] + (q[0] - p[0]) * t, p[1] + (q[1] - p[1]) * t];
    let left = along(quad[0], quad[3], rng.random_range(0.35..0.65));
    let right = along(quad[1], quad[2], rng.random_range(0.35..0.65));
    outlines.push(cut_stone(&[quad[0], quad[1], right, left], params, rng));
    outlines.push(cut_stone(&[left, right, quad[2], quad[3]], params, rng));
}

/// A stone from its place: joints left free around it and some corners knocked off.
fn cut_stone(quad: &[[f64; 2]; 4], params: &WallParams, rng: &mut ChaCha8Rng) -> Outline {
    let mut corners = Vec::with_capacity(8);
    let size = (quad[2][1] - quad[1][1]).min(quad[1][0] - quad[0][0]).max(0.02);
    for i in 0..4 {
        let (before, here, after) = (quad[(i + 3) % 4], quad[i], quad[(i + 1) % 4]);
        if rng.random_bool(0.5) {
            for to in [before, after] {
                let length = (to[0] - here[0]).hypot(to[1] - here[1]);
                let t = (size * rng.random_range(0.06..0.26) / length).min(0.45);
                corners.push([here[0] + (to[0] - here[0]) * t, here[1] + (to[1] - here[1]) * t]);
            }
        } else {
            corners.push(here);
        }
    }
    let gap = rng.random_range(params.joint_width_m[0]..=params.joint_width_m[1]);
    let corner = size * rng.random_range(0.08..0.26);
    Outline::new(&corners, 0.5 * gap, corner)
}
