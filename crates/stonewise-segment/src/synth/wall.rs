//! Paints a wall: finds the stone behind every sample of the canvas and asks what its surface looks like there.

use super::canvas::Canvas;
use super::draw::{Rng, between, chance, log_between, mix, smoothstep};
use super::layout::{Bond, Extent};
use super::material::{Look, Material, Mortar, Surface};
use super::noise::{Field, Grain};
use super::stone::{Stone, StoneIndex, StoneShape};
use super::view::View;

/// Least share of a stone's cell that mortar leaves open for the stone to count as visible.
const MIN_OPEN_SHARE: f32 = 0.4;

/// A wall of one kind of masonry.
#[derive(Clone, Debug, PartialEq)]
pub struct Wall {
    /// How the stones are laid.
    pub bond: Bond,
    /// Square root of a stone's area, about the median, 10 to 300 pixels in the middle of the photo.
    pub stone_px: f32,
    /// How stones depart from their cells.
    pub shape: StoneShape,
    /// What the stones are made of.
    pub material: Material,
    /// What lies between them.
    pub mortar: Mortar,
}

impl Wall {
    /// A wall drawn at random, its stones between `smallest` and `largest` pixels at the median.
    pub(super) fn random(rng: &mut Rng, smallest: f32, largest: f32) -> Self {
        let bond = Bond::random(rng);
        let stone_px = log_between(rng, smallest, largest);
        let material = Material::random(rng);
        let mortar = Mortar::random(rng, &material, stone_px);
        Self {
            bond,
            stone_px,
            shape: StoneShape::random(rng, matches!(bond, Bond::Rubble { .. })),
            material,
            mortar,
        }
    }

    /// Paints the wall where `region` holds; the stones get the canvas's next labels.
    pub(super) fn paint(&self, canvas: &mut Canvas, view: &View, region: &[bool], rng: &mut Rng) {
        let stones = self.stones(view.extent(), rng);
        let surface = Surface::new(&self.material, &self.mortar, self.stone_px, rng);
        let looks: Vec<Look> = stones
            .iter()
            .map(|stone| surface.look(stone.centre, stone.size, rng))
            .collect();
        let index = StoneIndex::new(&stones, 0.6 * self.stone_px);
        let gaps: Vec<bool> = stones.iter().map(|_| chance(rng, self.shape.missing)).collect();
        let wander = [0.9 * self.stone_px, 0.9 * self.stone_px, 0.25 * self.stone_px]
            .map(|px| Field::isotropic(rng, Grain::Smooth, px));
        let ragged = Field::isotropic(rng, Grain::Fractal, 0.5 * self.stone_px);
        let half_joint = 0.5 * self.mortar.width * self.stone_px;
        let joint_openness = surface.joint_openness(self.stone_px);
        let first_label = canvas.stones + 1;
        let mut areas = vec![[0u32; 2]; stones.len()];

        for y in 0..canvas.height {
            for x in 0..canvas.width {
                let i = y * canvas.width + x;
                if !region[i] {
                    continue;
                }
                let [px, py] = canvas.photo(x, y);
                let samples = view.scale(px, py) * canvas.scale;
                let [u, v] = view.wall(px, py);
                let shift = self.shape.wander * self.stone_px;
                let (s, t) = if shift > 0.0 {
                    let fine = 0.35 * wander[2].at(u, v);
                    (
                        u + shift * (0.5 * wander[0].at(u, v) + fine),
                        v + shift * (0.5 * wander[1].at(u, v) - fine),
                    )
                } else {
                    (u, v)
                };
                let found = index.find(&stones, s, t).filter(|&(k, _)| !gaps[k]);
                let inside = found.map_or(-self.stone_px, |(k, distance)| {
                    let shift = looks[k].retreat * half_joint;
                    let wave = self.shape.ragged * stones[k].size * ragged.at(s + 71.0 * k as f32, t);
                    distance - half_joint - shift + wave - surface.smear(u, v, self.stone_px)
                });
                // Coverage of the sample by the stone: the outline is straight on this scale.
                let coverage = (inside * samples + 0.5).clamp(0.0, 1.0);
                let (mut albedo, mut height) = if coverage < 1.0 {
                    surface.mortar(u, v, -inside, self.stone_px)
                } else {
                    ([0.0; 3], 0.0)
                };
                if let Some((k, distance)) = found {
                    areas[k][0] += u32::from(distance > 0.0);
                    if coverage > 0.0 {
                        let stone = &stones[k];
                        let offset = [s - stone.centre[0], t - stone.centre[1]];
                        let (colour, face) = surface.stone(&looks[k], [u, v], offset, inside, stone.size);
                        albedo = mix(albedo, colour, coverage);
                        height += coverage * (face - height);
                    }
                    if inside > 0.0 {
                        areas[k][1] += 1;
                    }
                }
                canvas.albedo[i] = albedo;
                canvas.relief[i] = height;
                let edge = (0.3 * half_joint).max(0.7);
                canvas.openness[i] =
                    joint_openness + (1.0 - joint_openness) * smoothstep(-half_joint.max(0.5), edge, inside);
                canvas.label[i] = match found {
                    Some((k, _)) if inside > 0.0 => first_label + k as u32,
                    _ => 0,
                };
                canvas.doubtful[i] = false;
            }
        }
        canvas.stones += stones.len() as u32;
        let hidden: Vec<bool> = areas
            .iter()
            .map(|&[cell, open]| (open as f32) < MIN_OPEN_SHARE * cell as f32)
            .collect();
        for (label, doubtful) in canvas.label.iter_mut().zip(&mut canvas.doubtful) {
            if *label >= first_label && hidden[(*label - first_label) as usize] {
                *label = 0;
                *doubtful = true;
            }
        }
    }

    fn stones(&self, extent: Extent, rng: &mut Rng) -> Vec<Stone> {
        let margin = 1.5 * self.stone_px;
        let extent = [
            extent[0] - margin,
            extent[1] - margin,
            extent[2] + margin,
            extent[3] + margin,
        ];
        // The wall's origin anywhere in the layout.
        let shift = [0, 1].map(|_| between(rng, 0.0, self.stone_px));
        let extent = [extent[0] - shift[0], extent[1] - shift[1], extent[2], extent[3]];
        self.bond
            .lay(self.stone_px, extent, rng)
            .iter()
            .filter_map(|ring| Stone::new(ring, &self.shape, rng))
            .collect()
    }
}
