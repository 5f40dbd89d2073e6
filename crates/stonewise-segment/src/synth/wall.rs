//! Paints a wall: finds the stone behind every sample of the canvas and asks what its surface looks like there.

use super::canvas::Canvas;
use super::draw::{Rng, between, chance, log_between, mix, smoothstep};
use super::layout::{Bond, Extent};
use super::material::{Look, Material, Mortar, Surface};
use super::noise::{Field, Grain};
use super::scene::Masonry;
use super::stone::{Stone, StoneIndex, StoneShape};
use super::view::View;

/// Least share of a stone's cell that mortar leaves open for the stone to count as visible.
const MIN_OPEN_SHARE: f32 = 0.4;

/// A wall of one kind of masonry.
#[derive(Clone, Debug, PartialEq)]
pub struct Wall {
    /// How the stones are laid.
    pub bond: Bond,
    /// Square root of a stone's area, about the median, 10 to 320 pixels in the middle of the photo.
    pub stone_px: f32,
    /// How stones depart from their cells.
    pub shape: StoneShape,
    /// What the stones are made of.
    pub material: Material,
    /// What lies between them.
    pub mortar: Mortar,
}

/// Where an arch stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ring {
    /// Middle of the circle in parts of the photo's width and height.
    pub centre: [f32; 2],
    /// Radius of the inner edge, pixels.
    pub radius_px: f32,
    /// Length of the stones away from the middle, pixels.
    pub depth_px: f32,
}

impl Wall {
    /// A wall drawn at random, its stones between `smallest` and `largest` pixels at the median.
    pub(super) fn random(rng: &mut Rng, smallest: f32, largest: f32) -> Self {
        let bond = Bond::random(rng);
        let stone_px = log_between(rng, smallest, largest);
        let mut material = Material::random(rng);
        let mut mortar = Mortar::random(rng, &material, stone_px);
        make_visible(&mut material, &mut mortar, stone_px, rng);
        Self {
            bond,
            stone_px,
            shape: StoneShape::random(rng, matches!(bond, Bond::Rubble { .. })),
            material,
            mortar,
        }
    }

    /// Paints the wall where `region` holds; the stones get the canvas's next labels.
    pub(super) fn paint(
        &self,
        canvas: &mut Canvas,
        view: &View,
        region: &[bool],
        masonry: &Masonry,
        rng: &mut Rng,
    ) {
        let bend = masonry.ring.map(|ring| Bend::new(&ring, view, canvas));
        let stones = match (&bend, masonry.ring) {
            (Some(bend), Some(ring)) => self.stones(bend.extent(ring.depth_px), rng),
            _ => self.stones(self.roomy(view.extent(), rng), rng),
        };
        let surface = Surface::new(&self.material, &self.mortar, self.stone_px, rng);
        let looks: Vec<Look> = stones
            .iter()
            .map(|stone| surface.look(stone.centre, stone.size, rng))
            .collect();
        let index = StoneIndex::new(&stones, 0.6 * self.stone_px);
        let gaps: Vec<bool> = stones
            .iter()
            .map(|stone| {
                let missing = chance(rng, self.shape.missing);
                missing
                    || (masonry.whole_stones && bend.is_none() && !centred_in(canvas, region, view, stone))
            })
            .collect();
        let wander = [0.9 * self.stone_px, 0.9 * self.stone_px, 0.25 * self.stone_px]
            .map(|px| Field::isotropic(rng, Grain::Smooth, px));
        let ragged = Field::isotropic(rng, Grain::Fractal, 0.5 * self.stone_px);
        let half_joint = 0.5 * self.mortar.width * self.stone_px;
        let joint_openness = surface.joint_openness(self.stone_px);
        let first_label = canvas.stones + 1;
        let mut areas = vec![[0u32; 2]; stones.len()];

        // A guess is good for a row of samples.
        for y in 0..canvas.height {
            let mut guess = None;
            for x in 0..canvas.width {
                let i = y * canvas.width + x;
                if !region[i] && !masonry.whole_stones {
                    continue;
                }
                let [px, py] = canvas.photo(x, y);
                let samples = view.scale(px, py) * canvas.scale;
                let [u, v] = view.wall(px, py);
                let [u, v] = bend.as_ref().map_or([u, v], |bend| bend.straighten([u, v]));
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
                let found = index.find(&stones, s, t, guess);
                guess = found.map(|(k, _)| k);
                let found = found.filter(|&(k, _)| !gaps[k]);
                if found.is_none() && masonry.whole_stones {
                    continue;
                }
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
                canvas.facing[i] = masonry.facing;
                canvas.sky[i] = false;
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

    /// The extent with a margin and the layout's origin anywhere.
    fn roomy(&self, extent: Extent, rng: &mut Rng) -> Extent {
        let margin = 1.5 * self.stone_px;
        let mut shift = || margin + between(rng, 0.0, self.stone_px);
        [
            extent[0] - shift(),
            extent[1] - shift(),
            extent[2] + margin,
            extent[3] + margin,
        ]
    }

    fn stones(&self, extent: Extent, rng: &mut Rng) -> Vec<Stone> {
        self.bond
            .lay(self.stone_px, extent, rng)
            .iter()
            .filter_map(|ring| Stone::new(ring, &self.shape, rng))
            .collect()
    }
}

/// Leaves at least one sign by which a person could tell stones apart: the joints' colour, their depth, or the stones' tones.
fn make_visible(material: &mut Material, mortar: &mut Mortar, stone_px: f32, rng: &mut Rng) {
    let brightness = |c: [f32; 3]| c[0] + c[1] + c[2];
    let stone = material.colours.first().map_or(1.0, |&c| brightness(c));
    let contrast = (brightness(mortar.colour) / stone.max(1e-3)).ln().abs();
    let width_px = mortar.width * stone_px;
    let rough_px = material.relief.roughness * stone_px;
    let by_colour = contrast * width_px.min(1.5) > 0.2 + 0.5 * material.mottle + 0.2 * material.accent;
    let by_depth = mortar.recess * stone_px > 0.8 + rough_px;
    let by_tone = material.tone_spread > 0.12 + 0.5 * material.mottle;
    if by_colour || by_depth || by_tone {
        return;
    }
    if chance(rng, 0.6) {
        mortar.width = mortar.width.max((0.7 + 0.5 * rough_px) / stone_px);
        mortar.recess = (between(rng, 0.8, 2.5) + rough_px) / stone_px;
    } else {
        material.tone_spread = between(rng, 0.13, 0.3);
        material.mottle *= 0.3;
    }
}

/// True where the middle of a stone lies in the region.
fn centred_in(canvas: &Canvas, region: &[bool], view: &View, stone: &Stone) -> bool {
    let at = view.photo(stone.centre).map(|c| c * canvas.scale);
    let inside = at[0] >= 0.0 && at[1] >= 0.0;
    let (x, y) = (at[0] as usize, at[1] as usize);
    inside && x < canvas.width && y < canvas.height && region[y * canvas.width + x]
}

/// Bends a straight course to a ring: `x` along its inner edge, `y` from -depth at its outer edge to 0 at its inner.
struct Bend {
    centre: [f32; 2],
    radius: f32,
}

impl Bend {
    fn new(ring: &Ring, view: &View, canvas: &Canvas) -> Self {
        let size = canvas.photo_size();
        Self {
            centre: view.wall(ring.centre[0] * size[0], ring.centre[1] * size[1]),
            radius: ring.radius_px,
        }
    }

    fn straighten(&self, [u, v]: [f32; 2]) -> [f32; 2] {
        let (dx, dy) = (u - self.centre[0], v - self.centre[1]);
        [self.radius * dx.atan2(-dy), self.radius - dx.hypot(dy)]
    }

    fn extent(&self, depth: f32) -> Extent {
        let half = std::f32::consts::PI * self.radius;
        [-half, -depth, half, 0.0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synth::layout::BrickPattern;
    use crate::synth::scene::masonry;
    use crate::synth::view::Viewpoint;
    use nalgebra::{Rotation3, Vector3};
    use rand::SeedableRng;
    use stonewise_core::raster::fill_polygon;

    #[test]
    fn labels_are_the_polygons_seen_by_a_pinhole_camera() {
        let mut rng = Rng::seed_from_u64(4);
        let viewpoint = Viewpoint {
            roll: 0.2,
            yaw: 0.6,
            pitch: -0.3,
            focal: 1.5,
            distortion: 0.0,
        };
        let mut wall = Wall::random(&mut rng, 30.0, 31.0);
        wall.bond = Bond::Brick {
            aspect: 2.0,
            pattern: BrickPattern::Running,
        };
        wall.shape = StoneShape {
            rounding: 0.0,
            chips: 0.0,
            ragged: 0.0,
            wander: 0.0,
            missing: 0.0,
        };
        wall.mortar.width = 0.0;
        wall.mortar.smear = 0.0;
        let (width, height) = (160u32, 120u32);
        let view = View::new(&viewpoint, width, height);
        let mut canvas = Canvas::new(width, height, 1.0);
        let everywhere = vec![true; canvas.label.len()];
        // The same numbers are drawn again below for the polygons.
        let mut again = rng.clone();
        let content = masonry(wall.clone(), viewpoint);
        wall.paint(&mut canvas, &view, &everywhere, &content, &mut rng);

        let focal = 1.5 * 160.0;
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), 0.2)
            * Rotation3::from_axis_angle(&Vector3::y_axis(), 0.6)
            * Rotation3::from_axis_angle(&Vector3::x_axis(), -0.3);
        let seen = |p: &[f32; 2]| {
            let ray = turn * Vector3::new(f64::from(p[0]), f64::from(p[1]), 0.0);
            let z = ray.z + focal;
            [80.0 + focal * ray.x / z, 60.0 + focal * ray.y / z]
        };
        let extent = wall.roomy(view.extent(), &mut again);
        let rings = wall.bond.lay(wall.stone_px, extent, &mut again);
        let mut checked = 0;
        for (k, ring) in rings.iter().enumerate() {
            let outline: Vec<[f64; 2]> = ring.iter().map(seen).collect();
            let (mut inside, mut agree) = (0, 0);
            fill_polygon(&[outline], width, height, |y, from, to| {
                for x in from..to {
                    inside += 1;
                    agree += usize::from(canvas.label[(y * width + x) as usize] == k as u32 + 1);
                }
            });
            let painted = canvas.label.iter().filter(|&&l| l == k as u32 + 1).count();
            if inside > 150 {
                checked += 1;
                let overlap = agree as f64 / (inside + painted - agree) as f64;
                assert!(overlap > 0.93, "stone {k}: {overlap}");
            }
        }
        assert!(checked > 10, "{checked}");
    }
}
