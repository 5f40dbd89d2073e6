//! Paints a wall: finds the stone behind every sample of the canvas, and what its surface looks like there.

use super::canvas::Canvas;
use super::cell::Extent;
use super::draw::{Rng, chance, mix, smoothstep};
use super::material::{Look, Surface};
use super::noise::{Field, Grain};
use super::stone::{Stone, StoneIndex};
use super::view::{View, Viewpoint};
use super::wall::Wall;

/// Least share of a stone's cell that mortar leaves open for the stone to count as visible.
const MIN_OPEN_SHARE: f32 = 0.4;

/// A wall as it is seen.
#[derive(Clone, Debug, PartialEq)]
pub struct Masonry {
    /// The wall.
    pub wall: Wall,
    /// From where it is seen.
    pub viewpoint: Viewpoint,
    /// The sun's strength on this wall over that on a wall that faces the camera, 0.2 to 1.3.
    pub facing: f32,
    /// True where the wall ends along its stones, as a ruin does; else the border cuts through them.
    pub whole_stones: bool,
    /// Stones in a ring about a point of the photo instead of in a plane bond: an arch.
    pub ring: Option<Ring>,
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

impl Masonry {
    /// A wall that faces the sun as the camera does, cut by its borders.
    pub(super) fn plain(wall: Wall, viewpoint: Viewpoint) -> Self {
        Self {
            wall,
            viewpoint,
            facing: 1.0,
            whole_stones: false,
            ring: None,
        }
    }

    /// Paints the wall where `region` holds; the stones get the canvas's next labels.
    pub(super) fn paint(&self, canvas: &mut Canvas, view: &View, region: &[bool], rng: &mut Rng) {
        let built = Built::new(self, canvas, view, region, rng);
        let first_label = canvas.stones + 1;
        let mut areas = vec![Area::default(); built.stones.len()];

        // A guess is good for a row of samples.
        for y in 0..canvas.height {
            let mut guess = None;
            for x in 0..canvas.width {
                let i = y * canvas.width + x;
                if !region[i] && !self.whole_stones {
                    continue;
                }
                let place = built.place(view, canvas.photo(x, y), canvas.scale);
                let found = built
                    .index
                    .find(&built.stones, place.layout[0], place.layout[1], guess);
                guess = found.map(|(k, _)| k);
                let found = found.filter(|&(k, _)| !built.gaps[k]);
                if found.is_none() && self.whole_stones {
                    continue;
                }
                let sample = built.sample(&place, found);
                if let Some((k, distance)) = found {
                    areas[k].cell += u32::from(distance > 0.0);
                    areas[k].open += u32::from(sample.inside > 0.0);
                }
                canvas.albedo[i] = sample.albedo;
                canvas.relief[i] = sample.height;
                canvas.openness[i] = sample.openness;
                canvas.label[i] = match found {
                    Some((k, _)) if sample.inside > 0.0 => first_label + k as u32,
                    _ => 0,
                };
                canvas.doubtful[i] = false;
                canvas.piece[i] = canvas.current;
                canvas.facing[i] = self.facing;
                canvas.sky[i] = false;
            }
        }

        canvas.stones += built.stones.len() as u32;
        hide_covered(canvas, &areas, first_label);
    }
}

/// Samples of the canvas that belong to a stone.
#[derive(Clone, Copy, Default)]
struct Area {
    /// Samples in its cell.
    cell: u32,
    /// Samples in its cell that mortar does not cover.
    open: u32,
}

/// Takes the labels of stones away that mortar covers; what is there is doubtful.
fn hide_covered(canvas: &mut Canvas, areas: &[Area], first_label: u32) {
    let hidden: Vec<bool> = areas
        .iter()
        .map(|area| (area.open as f32) < MIN_OPEN_SHARE * area.cell as f32)
        .collect();
    for (label, doubtful) in canvas.label.iter_mut().zip(&mut canvas.doubtful) {
        if *label >= first_label && hidden[(*label - first_label) as usize] {
            *label = 0;
            *doubtful = true;
        }
    }
}

/// The stones of a wall with everything that was drawn for them.
struct Built<'a> {
    wall: &'a Wall,
    bend: Option<Bend>,
    stones: Vec<Stone>,
    index: StoneIndex,
    surface: Surface,
    looks: Vec<Look>,
    /// Places that are left without their stone.
    gaps: Vec<bool>,
    /// Noise that shifts joints: along, across, and finer.
    wander: [Field; 3],
    ragged: Field,
    half_joint: f32,
    joint_openness: f32,
}

/// Where a sample of the canvas lies.
struct Place {
    /// Samples of the canvas per unit of the wall.
    samples: f32,
    /// On the wall.
    wall: [f32; 2],
    /// In the straight layout of the stones.
    layout: [f32; 2],
}

/// What a sample of the canvas shows.
struct Painted {
    albedo: [f32; 3],
    height: f32,
    openness: f32,
    /// Distance to the outline of the stone's visible face, positive inside.
    inside: f32,
}

impl<'a> Built<'a> {
    fn new(masonry: &'a Masonry, canvas: &Canvas, view: &View, region: &[bool], rng: &mut Rng) -> Self {
        let wall = &masonry.wall;
        let bend = masonry.ring.map(|ring| Bend::new(&ring, view, canvas));
        let stones = match (&bend, masonry.ring) {
            (Some(bend), Some(ring)) => wall.stones(bend.extent(ring.depth_px), rng),
            _ => wall.stones(wall.roomy(view.extent(), rng), rng),
        };
        let surface = Surface::new(&wall.material, &wall.mortar, wall.stone_px, rng);
        let looks = stones
            .iter()
            .map(|stone| surface.look(stone.centre, stone.size, rng))
            .collect();
        let gaps = stones
            .iter()
            .map(|stone| {
                let missing = chance(rng, wall.shape.missing);
                missing
                    || (masonry.whole_stones && bend.is_none() && !centred_in(canvas, region, view, stone))
            })
            .collect();

        let wander = [0.9 * wall.stone_px, 0.9 * wall.stone_px, 0.25 * wall.stone_px]
            .map(|px| Field::isotropic(rng, Grain::Smooth, px));
        Self {
            wall,
            bend,
            index: StoneIndex::new(&stones, 0.6 * wall.stone_px),
            looks,
            gaps,
            wander,
            ragged: Field::isotropic(rng, Grain::Fractal, 0.5 * wall.stone_px),
            half_joint: 0.5 * wall.mortar.width * wall.stone_px,
            joint_openness: surface.joint_openness(wall.stone_px),
            surface,
            stones,
        }
    }

    /// Where a place of the photo lies; `scale`: samples per pixel.
    #[inline]
    fn place(&self, view: &View, [px, py]: [f32; 2], scale: f32) -> Place {
        let samples = view.scale(px, py) * scale;
        let [u, v] = view.wall(px, py);
        let [u, v] = self.bend.as_ref().map_or([u, v], |bend| bend.straighten([u, v]));
        let shift = self.wall.shape.wander * self.wall.stone_px;
        let layout = if shift > 0.0 {
            let fine = 0.35 * self.wander[2].at(u, v);
            [
                u + shift * (0.5 * self.wander[0].at(u, v) + fine),
                v + shift * (0.5 * self.wander[1].at(u, v) - fine),
            ]
        } else {
            [u, v]
        };
        Place {
            samples,
            wall: [u, v],
            layout,
        }
    }

    /// What a place shows. `found`: the stone whose cell holds it, and the distance to the cell's outline.
    #[inline]
    fn sample(&self, place: &Place, found: Option<(usize, f32)>) -> Painted {
        let (stone_px, [u, v], [s, t]) = (self.wall.stone_px, place.wall, place.layout);
        let inside = found.map_or(-stone_px, |(k, distance)| {
            let shift = self.looks[k].retreat * self.half_joint;
            let wave = self.wall.shape.ragged * self.stones[k].size * self.ragged.at(s + 71.0 * k as f32, t);
            distance - self.half_joint - shift + wave - self.surface.smear(u, v, stone_px)
        });

        // Coverage of the sample by the stone: the outline is straight on this scale.
        let coverage = (inside * place.samples + 0.5).clamp(0.0, 1.0);
        let (mut albedo, mut height) = if coverage < 1.0 {
            self.surface.mortar(u, v, -inside, stone_px)
        } else {
            ([0.0; 3], 0.0)
        };

        if let Some((k, _)) = found.filter(|_| coverage > 0.0) {
            let stone = &self.stones[k];
            let offset = [s - stone.centre[0], t - stone.centre[1]];
            let (colour, face) = self
                .surface
                .stone(&self.looks[k], [u, v], offset, inside, stone.size);
            albedo = mix(albedo, colour, coverage);
            height += coverage * (face - height);
        }

        let edge = (0.3 * self.half_joint).max(0.7);
        let open = smoothstep(-self.half_joint.max(0.5), edge, inside);
        Painted {
            albedo,
            height,
            openness: self.joint_openness + (1.0 - self.joint_openness) * open,
            inside,
        }
    }
}

/// True where the middle of a stone lies in the region.
fn centred_in(canvas: &Canvas, region: &[bool], view: &View, stone: &Stone) -> bool {
    let at = view.photo(stone.centre).map(|c| c * canvas.scale);
    let inside = at[0] >= 0.0 && at[1] >= 0.0;
    let (x, y) = (at[0] as usize, at[1] as usize);
    inside && x < canvas.width && y < canvas.height && region[y * canvas.width + x]
}

/// Bends a straight course to a ring: `x` along its inner edge, `y` from -depth at its outer edge to 0 at its
/// inner.
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
    use crate::train::synth::layout::{Bond, BrickPattern};
    use crate::train::synth::stone::StoneShape;
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
        let content = Masonry::plain(wall.clone(), viewpoint);
        content.paint(&mut canvas, &view, &everywhere, &mut rng);

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
