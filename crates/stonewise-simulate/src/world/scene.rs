//! One epoch of the wall and its surroundings, as rays meet it.

use crate::world::deform::TrueMotion;
use crate::world::drift::DriftGrid;
use crate::world::face::FacePoint;
use crate::world::props::{Material, Prop};
use crate::world::surface::Surface;
use crate::world::wall::Wall;
use nalgebra::{Point3, Vector3};
use stonewise_core::geometry::Rigid3;
use stonewise_core::id::StoneId;

/// What a ray met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance along the ray, metres.
    pub range_m: f64,
    /// Where, world frame.
    pub point: Point3<f64>,
    /// Outward unit normal there.
    pub normal: Vector3<f64>,
    /// Where on the face.
    pub face: FacePoint,
    /// What it is.
    pub target: Target,
}

/// A stone, or anything else.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target {
    /// Index in [`Wall::stones`], and the place in the stone's own frame, metres.
    Stone(usize, [f64; 2]),
    /// Mortar, with its place on the face of the first epoch, metres; or a thing that does not move.
    Other(Material, [f64; 2]),
}

impl Target {
    /// The stone's number; `None` on joints and surroundings.
    pub fn stone(&self) -> Option<StoneId> {
        match self {
            Self::Stone(i, _) => Some(StoneId(*i as u32 + 1)),
            Self::Other(..) => None,
        }
    }
}

/// A wall after its stones moved, with everything that stands around it.
pub struct Scene<'a> {
    wall: &'a Wall,
    surface: &'a Surface,
    props: Vec<&'a Prop>,
    stones: Vec<Placed>,
    cells: CellLists,
    drift: DriftGrid,
    /// No part of the wall lies outside these heights over the face, metres.
    layer: [f64; 2],
    /// No mortar lies higher over the face, metres.
    mortar_top: f64,
}

/// World to stone, as rows, for speed.
struct Placed {
    rows: [[f64; 4]; 3],
    world_from_stone: Rigid3,
    wall_index: usize,
    /// Index in the surface.
    patch: usize,
}

/// The wall's surface at a point: what lies there and how far above it the point is along the outward normal.
struct Clearance {
    height_m: f64,
    stone: Option<usize>,
    at: [f64; 2],
}

const CELL_M: f64 = 0.04;
/// Steepest surface that rays are sure not to jump over, metres per metre.
const SLOPE: f64 = 1.1;
/// A ray is at the surface when it is this close, metres.
const CLOSE_M: f64 = 1e-6;

impl<'a> Scene<'a> {
    /// The scene with stone `i` of the wall moved by `motions[i]`.
    pub fn new(wall: &'a Wall, surface: &'a Surface, motions: &[TrueMotion], props: &'a [Prop]) -> Self {
        let stones: Vec<Placed> = surface
            .stones
            .iter()
            .enumerate()
            .map(|(patch, (i, _))| {
                Placed::new(
                    &(motions[*i].second_from_first * wall.stones[*i].world_from_stone),
                    *i,
                    patch,
                )
            })
            .collect();
        let drift = DriftGrid::new(wall, surface.window, motions);
        let cells = CellLists::new(wall, surface.window, &stones);

        let reach = |get: fn(f64, f64) -> f64, start: f64| {
            stones
                .iter()
                .map(|s| face_n(wall, &s.world_from_stone))
                .fold(start, get)
        };

        // A stone of half a metre that turns by 0.1 rad lifts a corner by 5 cm at most.
        let layer = [
            reach(f64::min, 0.0) - 0.25,
            reach(f64::max, 0.0) + surface.top_m + 0.03,
        ];
        Self {
            wall,
            surface,
            props: props_near(wall, surface, props),
            stones,
            cells,
            mortar_top: surface.mortar.top() + drift.top(),
            drift,
            layer,
        }
    }

    /// The wall.
    pub fn wall(&self) -> &'a Wall {
        self.wall
    }

    /// The window of the face that the scene holds: smallest a, largest a, smallest u, largest u, metres.
    pub fn window(&self) -> [f64; 4] {
        self.surface.window
    }

    /// The first thing on the ray; `along` is a unit vector. Cost: about half a microsecond.
    pub fn trace(&self, from: &Point3<f64>, along: &Vector3<f64>) -> Option<Hit> {
        self.trace_beam(from, along, [0.0; 2]).map(|(hit, _)| hit)
    }

    /// The first thing on the axis of a beam, and the distance, metres, from which on the other rays of the beam have
    /// to be traced: before it they meet nothing. The beam is `spread[0]` metres wide to either side where it starts,
    /// and `spread[1]` a metre wider.
    pub(super) fn trace_beam(
        &self,
        from: &Point3<f64>,
        along: &Vector3<f64>,
        spread: [f64; 2],
    ) -> Option<(Hit, f64)> {
        let prop = self.first_prop(from, along);
        let limit = prop.map_or(f64::MAX, |n| n.0);
        if let Some(met) = self.march(from, along, 0.0, limit, spread) {
            let hit = self.wall_hit(from + along * met.range_m, met.range_m);
            return Some((hit, if prop.is_none() { met.free_m } else { 0.0 }));
        }
        prop.map(|(range_m, normal, material)| {
            let point = from + along * range_m;
            let hit = Hit {
                range_m,
                point,
                normal,
                face: self.wall.face.face_of(&point),
                target: Target::Other(material, [point.y, point.z]),
            };
            (hit, 0.0)
        })
    }

    /// What the first thing on the ray is.
    pub fn target_of(&self, from: &Point3<f64>, along: &Vector3<f64>) -> Option<Target> {
        let prop = self.first_prop(from, along);
        let limit = prop.map_or(f64::MAX, |n| n.0);
        let Some(met) = self.march(from, along, 0.0, limit, [0.0; 2]) else {
            return prop.map(|(range_m, _, material)| {
                let point = from + along * range_m;
                Target::Other(material, [point.y, point.z])
            });
        };
        let point = from + along * met.range_m;
        Some(self.target(&self.clearance(&point, &self.wall.face.face_of(&point))))
    }

    /// How far away a ray meets the first thing, where nothing lies before `start_m`.
    pub(super) fn range(&self, from: &Point3<f64>, along: &Vector3<f64>, start_m: f64) -> Option<f64> {
        let prop = self.first_prop(from, along).map(|(range, ..)| range);
        let wall = self.march(from, along, start_m, prop.unwrap_or(f64::MAX), [0.0; 2]);
        wall.map(|met| met.range_m).or(prop)
    }

    fn first_prop(&self, from: &Point3<f64>, along: &Vector3<f64>) -> Option<(f64, Vector3<f64>, Material)> {
        let mut nearest: Option<(f64, Vector3<f64>, Material)> = None;
        for prop in &self.props {
            let limit = nearest.map_or(f64::MAX, |n| n.0);
            if let Some((t, normal)) = prop.trace(from, along, limit) {
                nearest = Some((t, normal, prop.material));
            }
        }
        nearest
    }

    /// Whether a ray can meet anything whose place on the face lies within `part` (smallest a, largest a,
    /// smallest u, largest u, metres); says yes in doubt.
    pub(super) fn may_meet(&self, from: &Point3<f64>, along: &Vector3<f64>, part: [f64; 4]) -> bool {
        if self.props.iter().any(|p| p.is_near_ray(from, along, f64::MAX)) {
            return true;
        }
        let face = &self.wall.face;
        let at = |height_m: f64| {
            let t = face.come_down(from, along, height_m)?;
            Some(face.face_of(&(from + along * t)))
        };
        // What is between the two places lies on the way through the layer that holds the wall.
        let (Some(high), Some(low)) = (at(self.layer[1]), at(self.layer[0])) else {
            return true;
        };
        let beside = |p: f64, q: f64, least: f64, most: f64| p.max(q) < least || p.min(q) > most;
        !(beside(high.a, low.a, part[0], part[1]) || beside(high.u, low.u, part[2], part[3]))
    }

    /// Whether anything stands on the ray within `limit` metres.
    pub fn blocked(&self, from: &Point3<f64>, along: &Vector3<f64>, limit: f64) -> bool {
        self.props.iter().any(|p| p.trace(from, along, limit).is_some())
            || self.march(from, along, 0.0, limit, [0.0; 2]).is_some()
    }

    /// The wall's surface straight below or above a place on the face; `None` outside the masonry.
    pub fn on_face(&self, a: f64, u: f64) -> Option<Hit> {
        let (point, down) = self.come_down_at(a, u)?;
        Some(self.wall_hit(point, down))
    }

    /// The place straight below or above a place on the face, and what is there.
    pub(super) fn target_on_face(&self, a: f64, u: f64) -> Option<(Point3<f64>, Target)> {
        let (point, _) = self.come_down_at(a, u)?;
        let found = self.clearance(&point, &self.wall.face.face_of(&point));
        Some((point, self.target(&found)))
    }

    /// Where the way down from the top of the layer on a place of the face reaches the surface, and its length, metres.
    fn come_down_at(&self, a: f64, u: f64) -> Option<(Point3<f64>, f64)> {
        let face = &self.wall.face;
        let top = FacePoint {
            a,
            u,
            n: self.layer[1],
        };
        let (from, inwards) = (face.world_of(&top), -face.frame(a).out);
        // Stones lie almost level, so that the height over the surface hardly changes on the way down but for
        // the way itself.
        let mut down = 0.0;
        for _ in 0..8 {
            let point = from + inwards * down;
            let n = top.n - down;
            let gap = self.gap(&point, &FacePoint { a, u, n })?;
            if gap.abs() < CLOSE_M {
                return Some((point, down));
            }
            down += gap;
        }
        // But not on the steep side of a stone that leans.
        let met = self.march(&from, &inwards, 0.0, 1.0, [0.0; 2])?;
        Some((from + inwards * met.range_m, met.range_m))
    }

    fn target(&self, found: &Clearance) -> Target {
        match found.stone {
            Some(k) => Target::Stone(self.stones[k].wall_index, found.at),
            None => Target::Other(Material::Mortar, found.at),
        }
    }

    fn wall_hit(&self, point: Point3<f64>, range_m: f64) -> Hit {
        let f = self.wall.face.face_of(&point);
        let found = self.clearance(&point, &f);
        let normal = match found.stone {
            Some(k) => {
                let stone = &self.stones[k];
                let grid = &self.surface.stones[stone.patch].1;
                stone.world_from_stone * grid.normal(found.at[0], found.at[1])
            }
            None => {
                let frame = self.wall.face.frame(f.a);
                let local = self.surface.mortar.normal(found.at[0], found.at[1]);
                frame.face_from_world().transpose() * local
            }
        };
        Hit {
            range_m,
            point,
            normal,
            face: f,
            target: self.target(&found),
        }
    }

    /// Marches along the ray to the wall's surface and then closes in on it to a micrometre. Nothing lies
    /// before `start_m`.
    fn march(
        &self,
        from: &Point3<f64>,
        along: &Vector3<f64>,
        start_m: f64,
        limit: f64,
        spread: [f64; 2],
    ) -> Option<Met> {
        let face = &self.wall.face;
        let mut t = face.come_down(from, along, self.layer[1])?.max(start_m);
        let mut above: Option<(f64, f64)> = None;
        let mut free_m = 0.0;

        for _ in 0..200 {
            if t > limit {
                return None;
            }
            let p = from + along * t;
            let (f, out) = face.face_and_out(&p);
            let descent = -along.dot(&out);
            if f.n < self.layer[0] || (f.n > self.layer[1] && descent <= 0.0) {
                return None;
            }
            let Some(gap) = self.gap(&p, &f) else {
                above = None;
                t += 0.008;
                continue;
            };
            if gap <= 0.0 {
                // A ray that starts inside, or comes in from beside the masonry, meets nothing it could see.
                let (t0, g0) = above?;
                let range_m = self.close_in(from, along, (t0, g0), (t, gap));
                return Some(Met { range_m, free_m });
            }
            above = Some((t, gap));
            if gap > SLOPE * (spread[0] + spread[1] * t) {
                free_m = t;
            }
            let sideways = (1.0 - descent * descent).max(0.0).sqrt();
            t += (gap / (descent.max(0.0) + SLOPE * sideways)).max(4e-4);
        }

        None
    }

    /// Root of the gap between a place above and one below the surface (Illinois variant of regula falsi).
    fn close_in(
        &self,
        from: &Point3<f64>,
        along: &Vector3<f64>,
        above: (f64, f64),
        below: (f64, f64),
    ) -> f64 {
        let ((mut t0, mut g0), (mut t1, mut g1)) = (above, below);
        let mut side = 0;
        for _ in 0..40 {
            let t = (t0 * g1 - t1 * g0) / (g1 - g0);
            let p = from + along * t;
            let g = self.gap(&p, &self.wall.face.face_of(&p)).unwrap_or(g0);
            if g.abs() < CLOSE_M || (t1 - t0).abs() < CLOSE_M {
                return t;
            }
            if g > 0.0 {
                (t0, g0) = (t, g);
                if side == 1 {
                    g1 *= 0.5;
                }
                side = 1;
            } else {
                (t1, g1) = (t, g);
                if side == -1 {
                    g0 *= 0.5;
                }
                side = -1;
            }
        }

        0.5 * (t0 + t1)
    }

    /// Height of a point over the wall's surface; `None` beside the masonry.
    fn gap(&self, p: &Point3<f64>, f: &FacePoint) -> Option<f64> {
        let w = &self.surface.window;
        let inside = f.a >= w[0] && f.a <= w[1] && f.u >= w[2] && f.u <= w[3];
        inside.then(|| self.clearance(p, f).height_m)
    }

    #[inline]
    fn clearance(&self, p: &Point3<f64>, f: &FacePoint) -> Clearance {
        let mut lowest = Clearance {
            height_m: f64::MAX,
            stone: None,
            at: [0.0; 2],
        };

        for &k in self.cells.at(f.a, f.u) {
            let stone = &self.stones[k as usize];
            let [x, y, z] = stone.local(p);
            if let Some(h) = self.surface.stones[stone.patch].1.height(x, y)
                && z - h < lowest.height_m
            {
                lowest = Clearance {
                    height_m: z - h,
                    stone: Some(k as usize),
                    at: [x, y],
                };
            }
        }

        // Mortar is recessed: most of the time that says enough.
        if f.n - self.mortar_top < lowest.height_m {
            let drift = self.drift.at(f.a, f.u);
            let (a, u) = (f.a - drift[0], f.u - drift[1]);
            let mortar = self.surface.mortar.height(a, u).unwrap_or(-0.02) + drift[2];
            if f.n - mortar <= lowest.height_m {
                lowest = Clearance {
                    height_m: f.n - mortar,
                    stone: None,
                    at: [a, u],
                };
            }
        }

        lowest
    }
}

/// Where a ray met the wall.
struct Met {
    /// Distance along the ray, metres.
    range_m: f64,
    /// Up to here the other rays of the beam meet nothing, metres.
    free_m: f64,
}

impl Placed {
    fn new(world_from_stone: &Rigid3, wall_index: usize, patch: usize) -> Self {
        let m = world_from_stone.inverse().to_homogeneous();
        Self {
            rows: [0, 1, 2].map(|i| [m[(i, 0)], m[(i, 1)], m[(i, 2)], m[(i, 3)]]),
            world_from_stone: *world_from_stone,
            wall_index,
            patch,
        }
    }

    #[inline]
    fn local(&self, p: &Point3<f64>) -> [f64; 3] {
        self.rows.map(|r| r[0] * p.x + r[1] * p.y + r[2] * p.z + r[3])
    }
}

/// Things that can stand between the sampled part of the wall and a viewer in front of it; the
/// others would only cost time.
fn props_near<'a>(wall: &Wall, surface: &Surface, props: &'a [Prop]) -> Vec<&'a Prop> {
    /// More than anything stands out from the wall, metres.
    const OUT_M: f64 = 6.0;
    let [a0, a1, u0, u1] = surface.window;
    let at = |a: f64, u: f64| wall.face.world_of(&FacePoint { a, u, n: 0.0 });
    let middle = at(0.5 * (a0 + a1), 0.5 * (u0 + u1));
    let radius = (at(a0, u0) - middle).norm().max((at(a1, u1) - middle).norm());
    props
        .iter()
        .filter(|p| p.is_near(&middle, radius + OUT_M))
        .collect()
}

fn face_n(wall: &Wall, world_from_stone: &Rigid3) -> f64 {
    wall.face
        .face_of(&Point3::from(world_from_stone.translation.vector))
        .n
}

/// Which stones can lie over a place on the face, after they moved.
struct CellLists {
    origin: [f64; 2],
    size: [usize; 2],
    starts: Vec<u32>,
    stones: Vec<u32>,
}

impl CellLists {
    fn new(wall: &Wall, window: [f64; 4], stones: &[Placed]) -> Self {
        let origin = [window[0], window[2]];
        let size = [0, 2].map(|i| ((window[i + 1] - window[i]) / CELL_M) as usize + 1);
        let mut lists: Vec<Vec<u32>> = vec![Vec::new(); size[0] * size[1]];

        for (k, placed) in stones.iter().enumerate() {
            let b = moved_bounds(wall, placed);
            let range = |axis: usize| {
                let cell = |v: f64| {
                    ((v - origin[axis]) / CELL_M)
                        .floor()
                        .clamp(-1.0, size[axis] as f64)
                };
                let (low, high) = (
                    cell(b[2 * axis]).max(0.0),
                    cell(b[2 * axis + 1]).min(size[axis] as f64 - 1.0),
                );
                (low as usize)..((high + 1.0).max(0.0) as usize)
            };
            for j in range(1) {
                for i in range(0) {
                    lists[j * size[0] + i].push(k as u32);
                }
            }
        }

        let mut starts = vec![0u32];
        let mut flat = Vec::new();
        for list in lists {
            flat.extend(list);
            starts.push(flat.len() as u32);
        }

        Self {
            origin,
            size,
            starts,
            stones: flat,
        }
    }

    #[inline]
    fn at(&self, a: f64, u: f64) -> &[u32] {
        let i = (((a - self.origin[0]) / CELL_M) as usize).min(self.size[0] - 1);
        let j = (((u - self.origin[1]) / CELL_M) as usize).min(self.size[1] - 1);
        let cell = j * self.size[0] + i;
        &self.stones[self.starts[cell] as usize..self.starts[cell + 1] as usize]
    }
}

/// Bounds on the face of a stone where it lies now.
fn moved_bounds(wall: &Wall, placed: &Placed) -> [f64; 4] {
    const MARGIN_M: f64 = 0.03;
    let stone = &wall.stones[placed.wall_index];
    let mut b = [f64::MAX, f64::MIN, f64::MAX, f64::MIN];
    for i in 0..4 {
        let (a, u) = (stone.bounds[i & 1], stone.bounds[2 + (i >> 1)]);
        let corner = Point3::new(a - stone.middle[0], u - stone.middle[1], 0.0);
        let f = wall.face.face_of(&(placed.world_from_stone * corner));
        b = [b[0].min(f.a), b[1].max(f.a), b[2].min(f.u), b[3].max(f.u)];
    }
    [b[0] - MARGIN_M, b[1] + MARGIN_M, b[2] - MARGIN_M, b[3] + MARGIN_M]
}
