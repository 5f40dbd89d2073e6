//! How mortar moves with the stones around it.

use crate::world::deform::TrueMotion;
use crate::world::face::FacePoint;
use crate::world::wall::Wall;
use rayon::prelude::*;

/// How the mortar follows its stones: the mean of the motions around, in face components, smooth between
/// nodes.
pub(super) struct DriftGrid {
    origin: [f64; 2],
    size: [usize; 2],
    nodes: Vec<[f64; 3]>,
}

const DRIFT_STEP_M: f64 = 0.05;

impl DriftGrid {
    /// The drift over a window of the face.
    pub fn new(wall: &Wall, window: [f64; 4], motions: &[TrueMotion]) -> Self {
        let origin = [window[0] - DRIFT_STEP_M, window[2] - DRIFT_STEP_M];
        let size = [0, 2].map(|i| ((window[i + 1] - window[i]) / DRIFT_STEP_M) as usize + 4);
        let followed = near_window(wall, window, motions);
        let nodes = (0..size[0] * size[1])
            .into_par_iter()
            .map(|k| {
                let a = origin[0] + (k % size[0]) as f64 * DRIFT_STEP_M;
                let u = origin[1] + (k / size[0]) as f64 * DRIFT_STEP_M;
                drift_at(wall, motions, &followed, a, u)
            })
            .collect();
        Self { origin, size, nodes }
    }

    /// Most that the mortar moved outwards anywhere, metres.
    pub fn top(&self) -> f64 {
        self.nodes.iter().map(|d| d[2]).fold(f64::MIN, f64::max)
    }

    /// Drift (along, up, out) at a place on the face, metres.
    #[inline]
    pub fn at(&self, a: f64, u: f64) -> [f64; 3] {
        let gx = ((a - self.origin[0]) / DRIFT_STEP_M).clamp(0.0, self.size[0] as f64 - 1.001);
        let gy = ((u - self.origin[1]) / DRIFT_STEP_M).clamp(0.0, self.size[1] as f64 - 1.001);
        let (i, j) = (gx as usize, gy as usize);
        let (fx, fy) = (gx - i as f64, gy - j as f64);
        let k = j * self.size[0] + i;
        let (p, q) = (&self.nodes[k], &self.nodes[k + 1]);
        let (r, s) = (&self.nodes[k + self.size[0]], &self.nodes[k + self.size[0] + 1]);
        std::array::from_fn(|c| {
            let low = p[c] + (q[c] - p[c]) * fx;
            let high = r[c] + (s[c] - r[c]) * fx;
            low + (high - low) * fy
        })
    }
}

/// Stones that move with the wall, sorted into square cells for the search around a node.
struct Neighbours {
    origin: [f64; 2],
    size: [usize; 2],
    cells: Vec<Vec<usize>>,
}

const NEIGHBOUR_M: f64 = 0.5;

fn near_window(wall: &Wall, window: [f64; 4], motions: &[TrueMotion]) -> Neighbours {
    let origin = [window[0] - NEIGHBOUR_M, window[2] - NEIGHBOUR_M];
    let size = [0, 2].map(|i| ((window[i + 1] - window[i]) / NEIGHBOUR_M) as usize + 3);
    let mut cells = vec![Vec::new(); size[0] * size[1]];
    for (i, stone) in wall.stones.iter().enumerate() {
        let c = [0, 1].map(|k| ((stone.middle[k] - origin[k]) / NEIGHBOUR_M).floor());
        let inside = (0..2).all(|k| c[k] >= 0.0 && c[k] < size[k] as f64);
        if inside && !motions[i].loose {
            cells[c[1] as usize * size[0] + c[0] as usize].push(i);
        }
    }
    Neighbours { origin, size, cells }
}

fn drift_at(wall: &Wall, motions: &[TrueMotion], near: &Neighbours, a: f64, u: f64) -> [f64; 3] {
    let middle = [a, u];
    let cell = [0, 1].map(|k| ((middle[k] - near.origin[k]) / NEIGHBOUR_M).floor() as isize);
    let (mut weights, mut sum) = (0.0, [0.0; 3]);
    for j in cell[1] - 1..=cell[1] + 1 {
        for i in cell[0] - 1..=cell[0] + 1 {
            let outside = i < 0 || j < 0 || i >= near.size[0] as isize || j >= near.size[1] as isize;
            if outside {
                continue;
            }
            for &s in &near.cells[j as usize * near.size[0] + i as usize] {
                let b = &wall.stones[s].bounds;
                let dx = (b[0] - a).max(a - b[1]).max(0.0);
                let dy = (b[2] - u).max(u - b[3]).max(0.0);
                let weight = 1.0 / (dx * dx + dy * dy + 4e-4).powi(2);
                let p = wall.face.world_of(&FacePoint { a, u, n: 0.0 });
                let f = wall.face.face_of(&(motions[s].second_from_first * p));
                weights += weight;
                for (total, d) in sum.iter_mut().zip([f.a - a, f.u - u, f.n]) {
                    *total += weight * d;
                }
            }
        }
    }
    if weights > 0.0 {
        sum.map(|d| d / weights)
    } else {
        sum
    }
}
