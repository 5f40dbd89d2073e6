//! What stands around the wall and does not move: ground, banks, crown, an annex, railings, shrubs.

use crate::world::face::FacePoint;
use crate::world::wall::Wall;
use crate::world::wall_params::WallParams;
use nalgebra::{Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use stonewise_core::geometry::Rigid3;

/// What a ray can meet besides stones.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Material {
    /// The joints.
    Mortar,
    /// Grass and soil.
    Ground,
    /// Overgrown slopes beside the section.
    Bank,
    /// The crown's concrete.
    Concrete,
    /// The annex's walls.
    Plaster,
    /// The annex's door.
    Door,
    /// The annex's roof.
    Roof,
    /// Railings.
    Metal,
    /// Leaves.
    Leaf,
}

/// A body with one material.
#[derive(Clone, Debug)]
pub struct Prop {
    /// Its material.
    pub material: Material,
    /// Middle and radius of a sphere that holds it, world frame, metres.
    middle: Point3<f64>,
    radius_m: f64,
    shape: Form,
}

#[derive(Clone, Debug)]
enum Form {
    /// A box in a frame of its own: x out of the wall, y along it, z up.
    Box {
        min: Point3<f64>,
        max: Point3<f64>,
        box_from_world: Rigid3,
    },
    Leaves(Vec<Disc>),
}

#[derive(Clone, Debug)]
struct Disc {
    centre: Point3<f64>,
    normal: Vector3<f64>,
    radius_m: f64,
}

/// What stands in front of the wall.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SurroundingsParams {
    /// A small building at the foot that hides stones.
    pub annex: bool,
    /// A railing along the foot.
    pub railing: bool,
    /// Number of shrubs at the foot.
    pub shrubs: u32,
    /// Seed of the shrubs.
    pub seed: u64,
}

impl SurroundingsParams {
    /// Nothing before the wall.
    pub fn none() -> Self {
        Self {
            annex: false,
            railing: false,
            shrubs: 0,
            ..Self::default()
        }
    }
}

impl Default for SurroundingsParams {
    fn default() -> Self {
        Self {
            annex: true,
            railing: true,
            shrubs: 2,
            seed: 1,
        }
    }
}

impl Prop {
    /// Distance along the ray to the first hit within `limit`, and the outward normal there.
    pub fn trace(&self, from: &Point3<f64>, along: &Vector3<f64>, limit: f64) -> Option<(f64, Vector3<f64>)> {
        if !self.is_near_ray(from, along, limit) {
            return None;
        }
        match &self.shape {
            Form::Box {
                min,
                max,
                box_from_world,
            } => {
                let (from, along) = (box_from_world * from, box_from_world * along);
                let (t, normal) = trace_box(&from, &along, min, max, limit)?;
                Some((t, box_from_world.rotation.inverse() * normal))
            }
            Form::Leaves(discs) => discs
                .iter()
                .filter_map(|d| trace_disc(from, along, d, limit))
                .min_by(|p, q| p.0.total_cmp(&q.0)),
        }
    }

    /// Whether the body may lie on a ray, within `limit`.
    #[inline]
    pub(super) fn is_near_ray(&self, from: &Point3<f64>, along: &Vector3<f64>, limit: f64) -> bool {
        let to = self.middle - from;
        let t = to.dot(along);
        to.norm_squared() - t * t <= self.radius_m * self.radius_m && t - self.radius_m <= limit
    }

    /// Whether the point lies inside the body, leaves apart.
    pub fn contains(&self, p: &Point3<f64>) -> bool {
        match &self.shape {
            Form::Box {
                min,
                max,
                box_from_world,
            } => {
                let p = box_from_world * p;
                (0..3).all(|i| min[i] < p[i] && p[i] < max[i])
            }
            Form::Leaves(_) => false,
        }
    }

    /// Whether any of the body may lie within `radius_m` of a place.
    pub(super) fn is_near(&self, place: &Point3<f64>, radius_m: f64) -> bool {
        match &self.shape {
            Form::Box {
                min,
                max,
                box_from_world,
            } => {
                let p = box_from_world * place;
                let nearest = p.coords.sup(&min.coords).inf(&max.coords);
                (p.coords - nearest).norm() <= radius_m
            }
            Form::Leaves(_) => (self.middle - place).norm() <= radius_m + self.radius_m,
        }
    }
}

/// Where things are put: beside a place at the foot of the wall.
struct Site<'a> {
    wall: &'a Wall,
    props: Vec<Prop>,
}

impl Site<'_> {
    /// Adds a box that stands at `a` along the wall; corners relative to the foot of the face there: x out, y
    /// along, z up.
    fn block(&mut self, material: Material, a: f64, min: [f64; 3], max: [f64; 3]) {
        let (min, max, foot) = (Point3::from(min), Point3::from(max), self.foot(a));
        self.props.push(Prop {
            material,
            middle: foot * nalgebra::center(&min, &max),
            radius_m: 0.5 * (max - min).norm(),
            shape: Form::Box {
                min,
                max,
                box_from_world: foot.inverse(),
            },
        });
    }

    /// Pose of the foot of the face at `a`: x level and out of the wall, y along it, z up.
    fn foot(&self, a: f64) -> Rigid3 {
        let along = self.wall.face.frame(a).along;
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), (-along.x).atan2(along.y));
        let at = self.wall.face.world_of(&FacePoint { a, u: 0.0, n: 0.0 });
        Rigid3::from_parts(
            Translation3::from(at.coords),
            UnitQuaternion::from_rotation_matrix(&turn),
        )
    }
}

/// Longest straight piece of the crown of a curved wall, metres.
const CROWN_PIECE_M: f64 = 4.0;

/// The surroundings of a wall; ground is z = 0.
pub fn surroundings(wall: &Wall, params: &SurroundingsParams) -> Vec<Prop> {
    use Material::{Bank, Concrete, Ground};
    let WallParams {
        width_m,
        height_m,
        batter,
        ..
    } = *wall.params();
    let half = width_m / 2.0;
    let top = height_m / batter.hypot(1.0);
    let back = -batter * top;
    let mut site = Site {
        wall,
        props: Vec::new(),
    };

    let far = 90.0 + width_m;
    site.block(Ground, 0.0, [-far, -far, -2.0], [far, far, 0.0]);
    let pieces = if wall.face.is_plane() {
        1.0
    } else {
        (width_m / CROWN_PIECE_M).ceil()
    };
    let length = width_m / pieces;

    for k in 0..pieces as usize {
        let a = -half + (k as f64 + 0.5) * length;
        // Pieces of a curve meet behind the face with a gap or an overlap of a centimetre.
        let end = 0.5 * length + if pieces > 1.0 { 0.02 } else { 0.0 };
        site.block(
            Concrete,
            a,
            [back - 3.0, -end, -0.5],
            [back - 0.12, end, top - 0.03],
        );
    }

    site.block(Bank, half, [-40.0, 0.0, -0.5], [0.02, 60.0, top + 0.15]);
    site.block(Bank, -half, [-40.0, -60.0, -0.5], [0.02, 0.0, top + 0.05]);
    if params.annex {
        annex(&mut site, width_m, height_m);
    }
    if params.railing {
        railing(&mut site, half, height_m);
    }
    let mut rng = ChaCha8Rng::seed_from_u64(params.seed);

    for k in 0..params.shrubs {
        let share = (f64::from(k) + rng.random_range(0.25..0.75)) / f64::from(params.shrubs);
        let foot = site.foot(-half + width_m * share) * Point3::new(0.3, 0.0, 0.0);
        let body = shrub([foot.x, foot.y], 0.09 * height_m.min(5.0), &mut rng);
        site.props.push(body);
    }

    site.props
}

fn annex(site: &mut Site, width_m: f64, height_m: f64) {
    use Material::{Door, Plaster, Roof};
    let (a, w, h) = (0.12 * width_m, 0.17 * width_m.min(14.0), 0.36 * height_m.min(8.0));
    site.block(Plaster, a, [0.35, 0.0, 0.0], [0.35 + 0.8 * w, w, h]);
    site.block(
        Door,
        a,
        [0.35 + 0.8 * w, 0.3 * w, 0.0],
        [0.355 + 0.8 * w, 0.65 * w, 0.8 * h],
    );
    site.block(Roof, a, [0.28, -0.07, h], [0.42 + 0.8 * w, w + 0.07, h + 0.08]);
}

fn railing(site: &mut Site, half: f64, height_m: f64) {
    use Material::Metal;
    let (from, to, x) = (-0.92 * half, -0.25 * half, 0.75);
    let h = 0.9f64.min(0.4 * height_m);
    let bays = ((to - from) / 1.4).ceil().max(1.0);
    let bay = (to - from) / bays;
    for k in 0..=bays as usize {
        let a = from + bay * k as f64;
        site.block(Metal, a, [x - 0.02, -0.02, 0.0], [x + 0.02, 0.02, h]);
        if k > 0 {
            for z in [0.5 * h, h] {
                let (low, high) = ([x - 0.018, -bay, z - 0.018], [x + 0.018, 0.0, z + 0.018]);
                site.block(Metal, a, low, high);
            }
        }
    }
}

fn shrub(foot: [f64; 2], radius_m: f64, rng: &mut ChaCha8Rng) -> Prop {
    let middle = Point3::new(foot[0], foot[1], 0.75 * radius_m);
    let mut unit = || -> Vector3<f64> {
        Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0))
            .try_normalize(1e-3)
            .unwrap_or_else(Vector3::z)
    };
    let discs = (0..170)
        .map(|k| {
            // More leaves outside than inside, and none under ground.
            let spread = radius_m * (0.35 + 0.6 * (f64::from(k) / 170.0).sqrt());
            let mut centre = middle + unit() * spread;
            centre.z = centre.z.abs().max(0.01);
            Disc {
                centre,
                normal: unit(),
                radius_m: 0.09 * radius_m + 0.008,
            }
        })
        .collect();
    Prop {
        material: Material::Leaf,
        middle,
        radius_m: 1.25 * radius_m,
        shape: Form::Leaves(discs),
    }
}

fn trace_box(
    from: &Point3<f64>,
    along: &Vector3<f64>,
    min: &Point3<f64>,
    max: &Point3<f64>,
    limit: f64,
) -> Option<(f64, Vector3<f64>)> {
    let (mut near, mut far, mut axis) = (f64::MIN, f64::MAX, 0);
    for i in 0..3 {
        let inverse = 1.0 / along[i];
        let (t0, t1) = ((min[i] - from[i]) * inverse, (max[i] - from[i]) * inverse);
        let (t0, t1) = if t0 < t1 { (t0, t1) } else { (t1, t0) };
        if t0 > near {
            (near, axis) = (t0, i);
        }
        far = far.min(t1);
    }
    if near > far || near <= 0.0 || near > limit {
        return None;
    }
    let mut normal = Vector3::zeros();
    normal[axis] = -along[axis].signum();
    Some((near, normal))
}

fn trace_disc(
    from: &Point3<f64>,
    along: &Vector3<f64>,
    disc: &Disc,
    limit: f64,
) -> Option<(f64, Vector3<f64>)> {
    let slope = disc.normal.dot(along);
    let t = disc.normal.dot(&(disc.centre - from)) / slope;
    if !(t > 0.0 && t <= limit) {
        return None;
    }
    let inside = (from + along * t - disc.centre).norm_squared() <= disc.radius_m * disc.radius_m;
    inside.then(|| (t, -disc.normal * slope.signum()))
}
