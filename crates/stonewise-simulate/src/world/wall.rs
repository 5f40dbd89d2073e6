//! A wall of rubble masonry: every stone's place, outline and shape, described so that any part can be
//! evaluated alone.

use crate::world::face::Face;
use crate::world::layout::{Outline, lay_stones};
use crate::world::noise::{Noise, Octaves, Row, normal};
use crate::world::wall_params::WallParams;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use stonewise_core::geometry::Rigid3;
use stonewise_core::id::StoneId;

/// One stone of the simulated wall, in the first epoch.
#[derive(Clone, Debug)]
pub struct SimStone {
    /// Number in the wall, from 1.
    pub id: StoneId,
    /// Pose of the stone's own frame: origin at its middle on the idealised face, axes along, up, out.
    pub world_from_stone: Rigid3,
    /// Its middle on the face: along and up, metres.
    pub middle: [f64; 2],
    /// Smallest a, largest a, smallest u, largest u on the face, metres.
    pub bounds: [f64; 4],
    /// Area of its outline, m^2.
    pub area_m2: f64,
    /// Whether the end of the section, the crown or the ground cuts it.
    pub edge: bool,
    pub(super) outline: Outline,
    pub(super) shape: Shape,
}

/// What one stone's face looks like.
#[derive(Clone, Debug)]
pub(super) struct Shape {
    /// Height of the face over the idealised face, metres.
    pub offset_m: f64,
    /// Slopes along x and y.
    pub tilt: [f64; 2],
    /// Amplitude of the first octave of relief, metres; the wavelength is 0.16 m.
    pub relief_m: f64,
    /// Amplitude of an octave over that of the one before.
    pub gain: f64,
    /// How far the edges are rounded, metres.
    pub round_m: f64,
    /// Planes that the mason's hammer left: slopes along x and y, and height in the middle, metres.
    pub facets: Vec<[f64; 3]>,
}

/// A wall: stones and the mortar between them.
#[derive(Clone, Debug)]
pub struct Wall {
    /// Its idealised face.
    pub face: Face,
    /// All stones; stone `i` has id `i + 1`.
    pub stones: Vec<SimStone>,
    params: WallParams,
    warp: [Noise; 2],
    relief: Noise,
    mortar: Noise,
}

/// Wavelengths of the waves that bend courses of [`WAVED_COURSE_M`], metres; larger stones have longer ones.
const WAVES_M: [f64; 2] = [0.75, 0.09];
/// Height of a course with these waves, metres.
const WAVED_COURSE_M: f64 = 0.21;
/// Wavelength of the coarsest relief, metres.
const RELIEF_M: f64 = 0.16;
/// Most that a facet takes off a stone, metres.
const FACET_M: f64 = 0.016;
/// Below this depth nothing of a stone is kept: mortar always lies higher, metres.
pub(super) const HIDDEN_M: f64 = -0.12;

impl Wall {
    /// Lays a wall. Cost: about a millisecond a stone, on all cores.
    pub fn new(params: &WallParams) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(params.seed);
        let outlines = lay_stones(params, &mut rng);
        let mut wall = Self {
            face: Face::new(params.batter, params.plan_radius_m),
            stones: Vec::new(),
            params: params.clone(),
            warp: [Noise::new(params.seed, 1), Noise::new(params.seed, 2)],
            relief: Noise::new(params.seed, 3),
            mortar: Noise::new(params.seed, 4),
        };
        let cut: Vec<(Outline, Shape)> = outlines
            .into_iter()
            .map(|o| (o, Shape::random(params, &mut rng)))
            .collect();
        let placed: Vec<_> = cut.into_par_iter().map(|(o, s)| wall.place(o, s)).collect();
        wall.stones = placed.into_iter().flatten().collect();
        for (i, stone) in wall.stones.iter_mut().enumerate() {
            stone.id = StoneId(i as u32 + 1);
        }
        wall
    }

    /// What the wall was made with.
    pub fn params(&self) -> &WallParams {
        &self.params
    }

    /// Extent of the masonry on the face: smallest a, largest a, smallest u, largest u, metres.
    pub fn extent(&self) -> [f64; 4] {
        let half = self.params.width_m / 2.0;
        [-half, half, -self.params.foot_m, self.params.height_m]
    }

    /// Height of the mortar over the idealised face along a row of face coordinates (a, u) of the first
    /// epoch, metres; negative, it is recessed.
    pub(super) fn mortar_heights(&self, row: Row, out: &mut [f64]) {
        let [shallow, deep] = self.params.joint_depth_m;
        out.fill(0.5);
        self.mortar
            .add_octaves(row.moved(0.0, 0.0, 0.5), octaves(2, 0.6, 1.1), out);
        for v in out.iter_mut() {
            *v = -(shallow + (deep - shallow) * v.clamp(0.0, 1.0));
        }
        self.mortar
            .add_octaves(row.moved(0.21, 0.0, 0.03), octaves(3, 0.6, 0.0022), out);
    }

    /// Height of stone `i`'s surface along a row of its own frame, metres; [`HIDDEN_M`] where it is hidden in
    /// the mortar. `waves`: what [`Wall::waves`] says about the places.
    pub(super) fn stone_heights(&self, i: usize, row: Row, waves: [&[f64]; 2], out: &mut [f64]) {
        let stone = &self.stones[i];
        let shape = &stone.shape;
        let u = stone.middle[1] + row.y;

        // How far the edge has fallen; then, only where any of the stone is left, the rest of its shape.
        for (k, v) in out.iter_mut().enumerate() {
            let a = stone.middle[0] + row.at(k);
            *v = -shape.edge_drop(stone.outline.distance(a + waves[0][k], u + waves[1][k]));
        }

        let there = |v: &f64| *v >= -0.1;
        let Some(first) = out.iter().position(there) else {
            out.fill(HIDDEN_M);
            return;
        };
        let end = out.iter().rposition(there).map_or(first, |last| last + 1);
        out[..first].fill(HIDDEN_M);
        out[end..].fill(HIDDEN_M);
        let (row, out) = (
            Row {
                x: row.at(first),
                ..row
            },
            &mut out[first..end],
        );

        // A place of its own in the noise, so that relief does not go on from stone to stone.
        let place = f64::from(stone.id.0) * 13.7;
        self.relief.add_octaves(
            row.moved(place, -place, RELIEF_M),
            octaves(6, shape.gain, shape.relief_m),
            out,
        );

        for (k, v) in out.iter_mut().enumerate() {
            *v = (*v + shape.plain_height(row.at(k), row.y)).max(HIDDEN_M);
        }
    }

    /// Distance from stone `i`'s outline at face coordinates (a, u) of the first epoch, metres, negative
    /// inside.
    pub fn outline_distance(&self, i: usize, a: f64, u: f64) -> f64 {
        let wave = [0, 1].map(|axis| {
            let mut wave = [0.0];
            self.waves(
                axis,
                Row {
                    x: a,
                    y: u,
                    step: 1.0,
                },
                &mut wave,
            );
            wave[0]
        });
        self.stones[i].outline.distance(a + wave[0], u + wave[1])
    }

    /// What bends the straight layout along a row of face coordinates: layout coordinate along (0) or up (1)
    /// less face coordinate, metres.
    pub(super) fn waves(&self, axis: usize, row: Row, out: &mut [f64]) {
        let size = [1.0, 1.15][axis] * self.params.course_m;
        let scale = self.params.course_m / WAVED_COURSE_M;
        let sums = [octaves(2, 0.5, 0.62 * size), octaves(3, 0.55, 0.045 * size)];
        out.fill(0.0);
        for (unit, sum) in WAVES_M.into_iter().zip(sums) {
            self.warp[axis].add_octaves(row.moved(0.0, 0.0, scale * unit), sum, out);
        }
    }

    /// Measures an outline on the face; `None` where nothing is left of it.
    fn place(&self, outline: Outline, shape: Shape) -> Option<SimStone> {
        const STEP: f64 = 0.012;
        let [x0, x1, y0, y1] = outline.bounds();
        let reach = 0.8 * self.params.course_m;
        let extent = self.extent();
        let mut bounds = [f64::MAX, f64::MIN, f64::MAX, f64::MIN];
        let (mut count, mut sum_a, mut sum_u, mut cut) = (0usize, 0.0, 0.0, false);
        let steps = |from: f64, to: f64| ((to - from + 2.0 * reach) / STEP) as usize;
        let mut waves = [0, 1].map(|_| vec![0.0; steps(x0, x1) + 1]);

        for j in 0..=steps(y0, y1) {
            let u = y0 - reach + j as f64 * STEP;
            let row = Row {
                x: x0 - reach,
                y: u,
                step: STEP,
            };
            for (axis, wave) in waves.iter_mut().enumerate() {
                self.waves(axis, row, wave);
            }
            for (i, (x, y)) in waves[0].iter().zip(&waves[1]).enumerate() {
                let a = row.at(i);
                if outline.distance(a + x, u + y) > 0.0 {
                    continue;
                }
                if a < extent[0] || a > extent[1] || u < extent[2] || u > extent[3] {
                    cut = true;
                    continue;
                }
                cut |= u < 0.0;
                count += 1;
                sum_a += a;
                sum_u += u;
                bounds = [
                    bounds[0].min(a),
                    bounds[1].max(a),
                    bounds[2].min(u),
                    bounds[3].max(u),
                ];
            }
        }

        if count < 12 {
            return None;
        }
        let margin = STEP;
        let ends = [
            x0 <= extent[0] + 1e-6,
            x1 >= extent[1] - 1e-6,
            y0 <= extent[2] + 1e-6,
            y1 >= extent[3] - 1e-6,
        ];
        let middle = [sum_a / count as f64, sum_u / count as f64];

        Some(SimStone {
            id: StoneId(0),
            world_from_stone: self.face.world_from_patch(middle[0], middle[1]),
            middle,
            bounds: [
                bounds[0] - margin,
                bounds[1] + margin,
                bounds[2] - margin,
                bounds[3] + margin,
            ],
            area_m2: count as f64 * STEP * STEP,
            edge: cut || ends.contains(&true),
            outline,
            shape,
        })
    }
}

/// Octaves of noise, written short.
fn octaves(count: u32, gain: f64, amplitude: f64) -> Octaves {
    Octaves {
        count,
        gain,
        amplitude,
    }
}

impl Shape {
    fn random(params: &WallParams, rng: &mut ChaCha8Rng) -> Self {
        let flat = rng.random_bool(params.flat_share);
        let strength = if flat {
            0.06
        } else {
            params.relief * (0.45 * normal(rng)).exp().clamp(0.4, 1.7)
        };
        let facets = if flat { 0 } else { rng.random_range(0..=3) };
        Self {
            offset_m: 0.006 + 0.005 * normal(rng).clamp(-2.0, 2.0),
            tilt: [0.0; 2].map(|_: f64| 0.03 * strength.min(1.3) * normal(rng).clamp(-2.0, 2.0)),
            relief_m: 0.012 * strength,
            gain: rng.random_range(0.40..0.54),
            round_m: rng.random_range(0.005..0.02),
            facets: (0..facets)
                .map(|_| {
                    let direction = rng.random_range(0.0..std::f64::consts::TAU);
                    let slope = rng.random_range(0.12..0.45);
                    [
                        slope * direction.cos(),
                        slope * direction.sin(),
                        rng.random_range(0.005..0.025),
                    ]
                })
                .collect(),
        }
    }

    /// Height of the face without its relief and its edges, in its own frame, metres.
    fn plain_height(&self, x: f64, y: f64) -> f64 {
        let mut height = self.offset_m + self.tilt[0] * x + self.tilt[1] * y;
        if !self.facets.is_empty() {
            let facet = self.facets.iter().map(|f| f[2] + f[0] * x + f[1] * y);
            let facet = facet.fold(0.0, f64::min);
            // However long a facet is, it takes no more than this off the stone.
            if facet < 0.0 {
                height += FACET_M * ((facet / FACET_M).exp() - 1.0);
            }
        }
        height
    }

    /// How far the surface falls at this distance from the outline (negative inside), metres.
    fn edge_drop(&self, distance: f64) -> f64 {
        let r = self.round_m;
        if distance <= -r {
            return 0.0;
        }
        // A quarter circle that ends in a steep side.
        let x = ((distance + r) / r).min(0.97);
        let drop = r * (1.0 - (1.0 - x * x).sqrt());
        drop + 4.0 * (distance - (0.97 * r - r)).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stones_fill_the_wall_and_no_place_belongs_to_two() {
        let wall = Wall::new(&WallParams::sized([3.0, 2.0]));
        let [a0, a1, u0, u1] = wall.extent();
        let (mut covered, mut all) = (0, 0);
        for k in 0..4000 {
            let a = a0 + (a1 - a0) * (f64::from(k % 80) + 0.5) / 80.0;
            let u = u0 + (u1 - u0) * (f64::from(k / 80) + 0.5) / 50.0;
            let owners = (0..wall.stones.len())
                .filter(|&i| wall.outline_distance(i, a, u) < 0.0)
                .count();
            assert!(owners <= 1, "{owners} stones at {a}, {u}");
            covered += owners;
            all += 1;
        }
        let share = covered as f64 / f64::from(all);
        assert!((0.72..0.95).contains(&share), "{share}");
        let area: f64 = wall.stones.iter().map(|s| s.area_m2).sum();
        assert!((area / (share * 3.0 * 2.25) - 1.0).abs() < 0.03, "{area}");
        assert!(
            wall.stones
                .iter()
                .enumerate()
                .all(|(i, s)| s.id.0 as usize == i + 1)
        );
    }

    #[test]
    fn mortar_is_recessed_as_asked() {
        let params = WallParams::default();
        let wall = Wall::new(&params);
        let mut heights = vec![0.0; 2000];
        for (k, part) in heights.chunks_mut(150).enumerate() {
            let row = Row {
                x: -1.0,
                y: 0.017 * k as f64,
                step: 0.013,
            };
            wall.mortar_heights(row, part);
        }
        let mean = heights.iter().sum::<f64>() / heights.len() as f64;
        assert!((-0.025..-0.015).contains(&mean), "{mean}");
        assert!(heights.iter().all(|h| (-0.035..-0.005).contains(h)));
    }
}
