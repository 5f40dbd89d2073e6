//! Photos that together show each part of a wall often enough.

use super::hidden::Nearest;
use super::walls::Walls;
use crate::geometry::View;
use crate::parallel::in_parallel;
use crate::progress::{Interrupted, Progress};
use crate::surface::SurfaceCell;
use std::cmp::Reverse;

/// Cosine of the angle between a ray and the normal below which a photo shows more of the joints than of the
/// faces: 60 degrees.
const GOOD_COSINE: f64 = 0.5;
/// Cosine below which a photo shows nothing of a face: 80 degrees.
const LEAST_COSINE: f64 = 0.17;
/// Pixels on the wall may be this much larger than those of the photo that shows a place best.
const GOOD_PIXELS: f64 = 1.5;

/// What a photo shows of a cell of a wall.
#[derive(Clone, Copy, Debug)]
pub struct Sight {
    /// Which cell of [`Sights::cells`].
    pub cell: usize,
    /// Where its centroid lies, pixels.
    pub pixel: [f64; 2],
    /// Size of a pixel across the ray, metres.
    pub gsd_m: f64,
    /// Cosine of the angle between the ray and the normal.
    pub cosine: f64,
    /// Whether the photo also shows what lies within the edge of a cell around it.
    is_amid: bool,
}

impl Sight {
    /// Longer side of a pixel on the wall, metres.
    fn pixel_m(&self) -> f64 {
        self.gsd_m / self.cosine
    }
}

/// What photos show of the walls of a survey.
#[derive(Clone, Debug)]
pub struct Sights {
    /// Number of cells of the walls.
    pub cells: usize,
    /// What each photo shows, ascending by cell.
    pub of_photos: Vec<Vec<Sight>>,
}

impl Sights {
    /// Looks from every photo at the walls among the cells of a surface, which may hide each other.
    ///
    /// `cells`: with normals that point outside; `cell_m`: their edge. Cost: each cell is projected into each
    /// photo three times.
    ///
    /// # Errors
    /// Interruption.
    pub fn of(
        views: &[View],
        cells: &[SurfaceCell],
        cell_m: f64,
        progress: &dyn Progress,
    ) -> Result<Self, Interrupted> {
        let walls = Walls::among(cells, cell_m).cells;
        progress.begin("what the photos show", views.len() as u64);
        let of_photos = in_parallel(views.len(), |photo| {
            progress.check()?;
            let sights = sights(&views[photo], cells, &walls, cell_m);
            progress.advance(1);
            Ok(sights)
        })?;
        Ok(Self {
            cells: walls.len(),
            of_photos,
        })
    }

    /// Few photos of which `least` show each cell well, or as many as there are; in the order in which they
    /// were chosen, each the one that adds most to those before it.
    ///
    /// A photo shows a cell well from less than 60 degrees to its normal, away from the photo's border, with
    /// pixels on the wall up to half as large again as those of the photo that shows it best. Where fewer than
    /// `least` do, those with the next smallest pixels count as well.
    ///
    /// Source: greedy multicover (Rajagopalan and Vazirani 1998), without photos that later ones made needless.
    pub fn cover(&self, least: usize) -> Vec<usize> {
        let mut of_cells: Vec<Vec<(usize, &Sight)>> = vec![Vec::new(); self.cells];
        for (photo, sights) in self.of_photos.iter().enumerate() {
            for sight in sights {
                of_cells[sight.cell].push((photo, sight));
            }
        }
        // Cells that each photo counts for, and how many photos each cell still needs.
        let mut counts_for: Vec<Vec<usize>> = vec![Vec::new(); self.of_photos.len()];
        let mut missing = vec![0i64; self.cells];
        for (cell, seen) in of_cells.iter_mut().enumerate() {
            let best_m = { seen.iter() }.fold(f64::INFINITY, |best, (_, s)| best.min(s.pixel_m()));
            let limit_m = GOOD_PIXELS * best_m;
            let is_good = |s: &Sight| s.is_amid && s.cosine >= GOOD_COSINE && s.pixel_m() <= limit_m;
            seen.sort_by(|(_, a), (_, b)| {
                let order = is_good(b).cmp(&is_good(a));
                order.then(a.pixel_m().total_cmp(&b.pixel_m()))
            });
            let good = seen.iter().take_while(|(_, s)| is_good(s)).count();
            for (photo, _) in &seen[..seen.len().min(good.max(least))] {
                counts_for[*photo].push(cell);
            }
            missing[cell] = least.min(seen.len()) as i64;
        }

        let mut chosen = Vec::new();
        loop {
            let gain = |photo: &usize| counts_for[*photo].iter().filter(|c| missing[**c] > 0).count();
            let left = (0..counts_for.len()).filter(|photo| !chosen.contains(photo));
            let best = left.map(|p| (gain(&p), Reverse(p))).max();
            let Some((1.., Reverse(photo))) = best else { break };
            chosen.push(photo);
            for cell in &counts_for[photo] {
                missing[*cell] -= 1;
            }
        }
        for place in (0..chosen.len()).rev() {
            let own = &counts_for[chosen[place]];
            if own.iter().all(|cell| missing[*cell] < 0) {
                own.iter().for_each(|cell| missing[*cell] += 1);
                chosen.remove(place);
            }
        }
        chosen
    }
}

/// What a photo shows of the walls.
fn sights(view: &View, cells: &[SurfaceCell], walls: &[&SurfaceCell], cell_m: f64) -> Vec<Sight> {
    let nearest = Nearest::of(view, cells, cell_m);
    let centre = view.centre();
    let seen = walls.iter().enumerate().filter(|(_, cell)| nearest.sees(cell));
    let sight = |(number, cell): (usize, &&SurfaceCell)| {
        let at = view.project(&cell.centroid)?;
        let cosine = (centre - cell.centroid).normalize().dot(&cell.normal);
        let gsd_m = view.gsd_m(at.depth_m);
        let margin = cell_m / gsd_m;
        let is_amid = [[-1.0, 0.0], [1.0, 0.0], [0.0, -1.0], [0.0, 1.0]]
            .iter()
            .all(|[x, y]| view.is_inside([at.pixel[0] + x * margin, at.pixel[1] + y * margin]));
        (cosine >= LEAST_COSINE).then_some(Sight {
            cell: number,
            pixel: at.pixel,
            gsd_m,
            cosine,
            is_amid,
        })
    };
    seen.filter_map(sight).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Camera, Rigid3};
    use crate::id::ImageId;
    use crate::progress::Silent;
    use nalgebra::{Point3, Vector3};

    /// Half of the side of what a photo of [`photo`] shows of the wall, metres.
    const HALF_M: f64 = 2.5;
    const CELL_M: f64 = 0.25;

    /// Middles of the cells of a wall of 12 x 6 m, 10 m before the cameras.
    fn places() -> Vec<[f64; 2]> {
        let middle = |i: i32| CELL_M * (f64::from(i) + 0.5);
        (0..48)
            .flat_map(|i| (0..24).map(move |j| [middle(i), middle(j)]))
            .collect()
    }

    fn wall() -> Vec<SurfaceCell> {
        let cell = |[x, y]: [f64; 2]| SurfaceCell {
            cell: [0; 3],
            centroid: Point3::new(x, y, 10.0),
            normal: -Vector3::z(),
            spacing_m: 0.01,
            skewness: 0.0,
        };
        places().into_iter().map(cell).collect()
    }

    /// A photo of 5 x 5 m of the wall about a place.
    fn photo([x, y]: [f64; 2]) -> View {
        View {
            image: ImageId(0),
            name: String::new(),
            camera: Camera::pinhole(1000, 1000, 2000.0),
            cam_from_world: Rigid3::translation(-x, -y, 0.0),
        }
    }

    /// Middles of photos in steps of a metre: 80 % overlap.
    fn flight() -> Vec<[f64; 2]> {
        (0..=12)
            .flat_map(|i| (0..=6).map(move |j| [f64::from(i), f64::from(j)]))
            .collect()
    }

    fn chosen(views: &[View], cells: &[SurfaceCell], least: usize) -> Vec<usize> {
        let sights = Sights::of(views, cells, CELL_M, &Silent).unwrap();
        sights.cover(least)
    }

    /// How many photos about these places show a place at least so far from their border.
    fn count(photos: &[[f64; 2]], place: [f64; 2], margin_m: f64) -> usize {
        let reach = HALF_M - margin_m;
        let shows = |m: &&[f64; 2]| (m[0] - place[0]).abs() < reach && (m[1] - place[1]).abs() < reach;
        photos.iter().filter(shows).count()
    }

    #[test]
    fn every_place_keeps_enough_photos_of_a_flight_and_most_photos_go() {
        let flight = flight();
        let views: Vec<View> = flight.iter().map(|&place| photo(place)).collect();
        for least in [1, 4] {
            let chosen = chosen(&views, &wall(), least);
            let kept: Vec<[f64; 2]> = chosen.iter().map(|&i| flight[i]).collect();
            for place in places() {
                let all = count(&flight, place, CELL_M);
                assert!(count(&kept, place, CELL_M) >= least.min(all), "{place:?}");
            }
            // As few as areas allow are a fifteenth of a metre's grid for each time that the wall is shown.
            let fewest = least as f64 * (12.0 * 6.0) / (4.5 * 4.5);
            assert!((chosen.len() as f64) < 2.2 * fewest, "{} {fewest}", chosen.len());
        }
    }

    #[test]
    fn what_few_photos_show_keeps_all_of_them() {
        let places = [[2.0, 3.0], [3.0, 3.0], [9.0, 3.0]];
        let views = places.map(photo);
        let mut found = chosen(&views, &wall(), 4);
        found.sort_unstable();
        assert_eq!(found, [0, 1, 2]);
    }

    #[test]
    fn near_photos_are_taken_before_distant_ones() {
        // From twice as far, the same camera shows the wall in pixels twice as large.
        let far = View {
            cam_from_world: Rigid3::translation(-6.0, -3.0, 10.0),
            ..photo([0.0; 2])
        };
        let near = flight().into_iter().map(photo);
        let views: Vec<View> = std::iter::once(far).chain(near).collect();
        assert!(!chosen(&views, &wall(), 4).contains(&0));
        assert_eq!(chosen(&views[..1], &wall(), 4), [0]);
    }

    #[test]
    fn what_a_thing_before_the_wall_hides_is_not_shown() {
        let wall = wall();
        let thing = |[x, y]: [f64; 2]| SurfaceCell {
            centroid: Point3::new(x, y, 8.0),
            ..wall[0]
        };
        let hidden: Vec<SurfaceCell> = places()
            .into_iter()
            .filter(|p| p[0] > 2.0 && p[0] < 4.0)
            .map(thing)
            .collect();
        let all = [wall.clone(), hidden].concat();
        let sights = Sights::of(&[photo([3.0, 3.0])], &all, CELL_M, &Silent).unwrap();
        let behind = |s: &&Sight| s.cell < wall.len() && (all[s.cell].centroid.x - 3.0).abs() < 1.0;
        assert_eq!(sights.of_photos[0].iter().filter(behind).count(), 0);
    }
}
