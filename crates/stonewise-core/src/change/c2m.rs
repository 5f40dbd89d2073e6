//! Cloud to mesh distances.

use crate::change::TriangleMesh;
use crate::change::triangle::{Feature, nearest_on_triangle};
use crate::geometry::Bounds;
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// A mesh prepared for signed distances: its triangles sorted into cells, its normals at faces, edges,
/// vertices.
pub struct MeshIndex {
    mesh: TriangleMesh,
    face_normals: Vec<Vector3<f64>>,
    /// Sum of the normals of the faces at the edge from each corner of each triangle to the next.
    edge_normals: Vec<[Vector3<f64>; 3]>,
    /// Normals of the faces at each vertex, weighted with their angles there.
    vertex_normals: Vec<Vector3<f64>>,
    /// A sphere around each triangle, a cheap test for triangles that are too far.
    spheres: Vec<Sphere>,
    origin: Point3<f64>,
    cell_m: f64,
    dims: [usize; 3],
    /// Start of each cell in `members`; one more entry than cells.
    starts: Vec<u32>,
    members: Vec<u32>,
}

struct Sphere {
    centre: Point3<f64>,
    radius_m: f64,
}

/// More cells than this are never made; the cell grows instead.
const MAX_CELLS: f64 = 2e7;

/// Signed distance from each point to the mesh, metres; `None` beyond `max_m`.
///
/// Positive on the side from which the triangles' corners run counterclockwise.
pub fn c2m(mesh: &MeshIndex, points: &[Point3<f64>], max_m: f64) -> Vec<Option<f64>> {
    points
        .par_iter()
        .map(|p| mesh.signed_distance(p, max_m))
        .collect()
}

impl MeshIndex {
    /// Prepares a mesh. Cost: triangles x the cells that each one's box touches.
    pub fn new(mesh: TriangleMesh) -> Self {
        let bounds = mesh.bounds();
        let extent = bounds.max - bounds.min;
        let count = |cell: f64| extent.iter().map(|e| (e / cell).floor() + 1.0).product::<f64>();
        let mut cell_m = typical_size(&mesh);
        while count(cell_m) > MAX_CELLS {
            cell_m *= 1.26;
        }
        let (face_normals, edge_normals, vertex_normals) = normals(&mesh);
        let spheres = (0..mesh.triangles().len())
            .map(|t| sphere(&mesh.corners(t)))
            .collect();
        let mut index = Self {
            mesh,
            spheres,
            face_normals,
            edge_normals,
            vertex_normals,
            origin: bounds.min,
            cell_m,
            dims: [0, 1, 2].map(|a| (extent[a] / cell_m).floor() as usize + 1),
            starts: Vec::new(),
            members: Vec::new(),
        };
        index.sort_triangles();
        index
    }

    /// Box around the mesh.
    pub fn bounds(&self) -> Bounds {
        self.mesh.bounds()
    }

    /// Signed distance of a point, metres; `None` beyond `max_m`.
    ///
    /// The sign at edges and vertices follows the angle-weighted pseudonormal of Baerentzen & Aanaes (2005).
    pub fn signed_distance(&self, p: &Point3<f64>, max_m: f64) -> Option<f64> {
        let (triangle, nearest, feature) = self.nearest(p, max_m)?;
        let corners = self.mesh.triangles()[triangle];
        let normal = match feature {
            Feature::Face => self.face_normals[triangle],
            Feature::Edge(edge) => self.edge_normals[triangle][edge],
            Feature::Corner(corner) => self.vertex_normals[corners[corner] as usize],
        };
        let offset = p - nearest;
        Some(offset.norm().copysign(offset.dot(&normal)))
    }

    /// Visits the cells in shells around the point until what is left is further than what was found.
    fn nearest(&self, p: &Point3<f64>, max_m: f64) -> Option<(usize, Point3<f64>, Feature)> {
        let place = (p - self.origin) / self.cell_m;
        let cell = [0, 1, 2].map(|a| place[a].floor() as i64);
        let first = (0..3)
            .map(|a| (-cell[a]).max(cell[a] - self.dims[a] as i64 + 1))
            .fold(0, i64::max);
        let to_border = (0..3)
            .map(|a| (place[a] - place[a].floor()).min(1.0 - (place[a] - place[a].floor())))
            .fold(1.0, f64::min);
        let mut best: Option<(usize, Point3<f64>, Feature)> = None;
        let mut best_d2 = max_m * max_m;
        let mut shell = first;

        // Nothing outside of the shells before this one is nearer than their border.
        let before = |shell: i64| ((shell - 1) as f64 + to_border) * self.cell_m;
        while shell == 0 || before(shell).powi(2) <= best_d2 {
            let touched = self.visit_shell(cell, shell, |triangle| {
                let sphere = &self.spheres[triangle];
                let reach = best_d2.sqrt() + sphere.radius_m;
                if (p - sphere.centre).norm_squared() > reach * reach {
                    return;
                }
                let (q, feature) = nearest_on_triangle(p, &self.mesh.corners(triangle));
                let d2 = (q - p).norm_squared();
                let wins = match &best {
                    None => d2 <= best_d2,
                    Some((other, ..)) => d2.total_cmp(&best_d2).then(triangle.cmp(other)).is_lt(),
                };
                if wins {
                    best_d2 = d2;
                    best = Some((triangle, q, feature));
                }
            });
            if !touched {
                break;
            }
            shell += 1;
        }

        best
    }

    /// Visits the triangles of all cells that are `shell` cells away from `cell`; false where no such cell
    /// exists any more.
    fn visit_shell(&self, cell: [i64; 3], shell: i64, mut visit: impl FnMut(usize)) -> bool {
        let range = |a: usize| {
            let low = (cell[a] - shell).max(0);
            let high = (cell[a] + shell).min(self.dims[a] as i64 - 1);
            low..=high
        };
        let on_shell = |a: usize, i: i64| (i - cell[a]).abs() == shell;
        for k in range(2) {
            for j in range(1) {
                let row = (k as usize * self.dims[1] + j as usize) * self.dims[0];
                let mut visit_cell = |i: i64| {
                    let at = row + i as usize;
                    let members = &self.members[self.starts[at] as usize..self.starts[at + 1] as usize];
                    members.iter().for_each(|&t| visit(t as usize));
                };
                if on_shell(2, k) || on_shell(1, j) {
                    range(0).for_each(&mut visit_cell);
                } else {
                    range(0).filter(|&i| on_shell(0, i)).for_each(&mut visit_cell);
                }
            }
        }
        (0..3).any(|a| cell[a] - shell > 0 || cell[a] + shell < self.dims[a] as i64 - 1)
    }

    fn sort_triangles(&mut self) {
        let cells = |index: &Self, triangle: usize| {
            let corners = index.mesh.corners(triangle);
            let low = corners[0].inf(&corners[1]).inf(&corners[2]);
            let high = corners[0].sup(&corners[1]).sup(&corners[2]);
            index.cells_of_box(&low, &high)
        };
        let count = self.mesh.triangles().len();
        let mut starts = vec![0u32; self.dims.iter().product::<usize>() + 1];
        for triangle in 0..count {
            for cell in cells(self, triangle) {
                starts[cell + 1] += 1;
            }
        }
        for c in 1..starts.len() {
            starts[c] += starts[c - 1];
        }
        let mut next = starts.clone();
        let mut members = vec![0u32; *starts.last().unwrap_or(&0) as usize];
        for triangle in 0..count {
            for cell in cells(self, triangle) {
                members[next[cell] as usize] = triangle as u32;
                next[cell] += 1;
            }
        }
        self.starts = starts;
        self.members = members;
    }

    /// Cells that a box touches, ascending; none where it lies outside the grid.
    fn cells_of_box(&self, low: &Point3<f64>, high: &Point3<f64>) -> impl Iterator<Item = usize> + use<> {
        let dims = self.dims;
        let [x, y, z] = [0, 1, 2].map(|a| {
            let from = ((low[a] - self.origin[a]) / self.cell_m).floor();
            let to = ((high[a] - self.origin[a]) / self.cell_m).floor();
            if to < 0.0 || from >= dims[a] as f64 {
                0..0
            } else {
                from.max(0.0) as usize..(to as usize).min(dims[a] - 1) + 1
            }
        });
        z.flat_map(move |k| {
            let x = x.clone();
            y.clone()
                .flat_map(move |j| x.clone().map(move |i| (k * dims[1] + j) * dims[0] + i))
        })
    }
}

fn sphere(corners: &[Point3<f64>; 3]) -> Sphere {
    let centre = Point3::from((corners[0].coords + corners[1].coords + corners[2].coords) / 3.0);
    let radius_m = corners.iter().map(|c| (c - centre).norm()).fold(0.0, f64::max);
    Sphere { centre, radius_m }
}

/// Mean of the triangles' longest edges, metres.
fn typical_size(mesh: &TriangleMesh) -> f64 {
    let longest = |t: usize| {
        let [a, b, c] = mesh.corners(t);
        (b - a).norm().max((c - b).norm()).max((a - c).norm())
    };
    let count = mesh.triangles().len();
    (0..count).map(longest).sum::<f64>() / count as f64
}

type Normals = (Vec<Vector3<f64>>, Vec<[Vector3<f64>; 3]>, Vec<Vector3<f64>>);

fn normals(mesh: &TriangleMesh) -> Normals {
    let faces: Vec<Vector3<f64>> = (0..mesh.triangles().len())
        .map(|t| {
            let [a, b, c] = mesh.corners(t);
            (b - a).cross(&(c - a)).normalize()
        })
        .collect();
    let mut vertices = vec![Vector3::zeros(); mesh.vertices().len()];
    let mut edges: BTreeMap<(u32, u32), Vector3<f64>> = BTreeMap::new();
    let edge_key = |triangle: &[u32; 3], i: usize| {
        let (from, to) = (triangle[i], triangle[(i + 1) % 3]);
        (from.min(to), from.max(to))
    };
    for (t, triangle) in mesh.triangles().iter().enumerate() {
        let corners = mesh.corners(t);
        for i in 0..3 {
            let angle = (corners[(i + 1) % 3] - corners[i]).angle(&(corners[(i + 2) % 3] - corners[i]));
            vertices[triangle[i] as usize] += faces[t] * angle;
            *edges.entry(edge_key(triangle, i)).or_default() += faces[t];
        }
    }
    let per_triangle = mesh
        .triangles()
        .iter()
        .map(|triangle| [0, 1, 2].map(|i| edges.get(&edge_key(triangle, i)).copied().unwrap_or_default()))
        .collect();
    (faces, per_triangle, vertices)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::change::MeshError;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// A box from -1 to 1 in x, -0.5 to 0.5 in y, -2 to 2 in z, corners counterclockwise from outside.
    fn solid_box() -> TriangleMesh {
        let vertices: Vec<_> = (0..8)
            .map(|i| {
                let side = |bit: i32| if i >> bit & 1 == 1 { 1.0 } else { -1.0 };
                Point3::new(side(0), 0.5 * side(1), 2.0 * side(2))
            })
            .collect();
        let quads: [[u32; 4]; 6] = [
            [0, 4, 6, 2],
            [1, 3, 7, 5],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 2, 3, 1],
            [4, 5, 7, 6],
        ];
        let triangles = quads
            .iter()
            .flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]])
            .collect();
        TriangleMesh::new(vertices, triangles).unwrap()
    }

    /// Closed form: distance to an axis-aligned box, negative inside.
    fn box_distance(p: &Point3<f64>) -> f64 {
        let q = Vector3::new(p.x.abs() - 1.0, p.y.abs() - 0.5, p.z.abs() - 2.0);
        q.map(|v| v.max(0.0)).norm() + q.max().min(0.0)
    }

    #[test]
    fn distances_to_a_box_match_the_closed_form() {
        let mesh = MeshIndex::new(solid_box());
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let points: Vec<_> = (0..2000)
            .map(|_| Point3::from([3.0, 2.0, 4.0].map(|s: f64| rng.random_range(-s..s))))
            .collect();
        for (p, distance) in points.iter().zip(c2m(&mesh, &points, 10.0)) {
            assert!((distance.unwrap() - box_distance(p)).abs() < 1e-12, "{p}");
        }
        for (p, distance) in points.iter().zip(c2m(&mesh, &points, 0.4)) {
            assert_eq!(distance.is_some(), box_distance(p).abs() <= 0.4);
        }
    }

    /// A thin pyramid: at its sharp tip and edges single face normals point the wrong way.
    #[test]
    fn signs_hold_at_sharp_tips_and_edges() {
        let vertices = [
            [0.3, 0.3, 0.0],
            [-0.3, 0.3, 0.0],
            [-0.3, -0.3, 0.0],
            [0.3, -0.3, 0.0],
            [0.0, 0.0, 2.0],
        ]
        .map(Point3::from)
        .to_vec();
        let triangles = vec![[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [0, 2, 1], [0, 3, 2]];
        let mesh = TriangleMesh::new(vertices, triangles).unwrap();
        // Inside of a convex body is behind all of its faces.
        let inside = |p: &Point3<f64>| {
            (0..6).all(|t| {
                let [a, b, c] = mesh.corners(t);
                (b - a).cross(&(c - a)).dot(&(p - a)) < 0.0
            })
        };
        let index = MeshIndex::new(mesh.clone());
        let mut rng = ChaCha8Rng::seed_from_u64(6);
        let mut features = std::collections::BTreeSet::new();
        for _ in 0..4000 {
            let p = Point3::new(
                rng.random_range(-0.6..0.6),
                rng.random_range(-0.6..0.6),
                rng.random_range(-0.3..2.5),
            );
            let distance = index.signed_distance(&p, 5.0).unwrap();
            assert_eq!(distance < 0.0, inside(&p), "{p}: {distance}");
            let (_, _, feature) = index.nearest(&p, 5.0).unwrap();
            features.insert(format!("{feature:?}")[..4].to_owned());
        }
        assert_eq!(features.len(), 3);
    }

    #[test]
    fn meshes_that_cannot_work_are_refused() {
        let mut corners = vec![
            Point3::origin(),
            Point3::new(1.0, 0.0, 0.0),
            Point3::new(2.0, 0.0, 0.0),
        ];
        let missing = TriangleMesh::new(corners.clone(), vec![[0, 1, 3]]).unwrap_err();
        assert!(missing.to_string().contains("vertex 3"));
        let no_area = TriangleMesh::new(corners.clone(), vec![[0, 1, 2]]);
        assert_eq!(no_area, Err(MeshError::NoFaces));
        corners[2].y = f64::INFINITY;
        assert_eq!(
            TriangleMesh::new(corners, vec![[0, 1, 2]]),
            Err(MeshError::NoFaces)
        );
    }
}
