//! What the simulator promises about its photos, measured back from them.

use stonewise_core::geometry::View;
use stonewise_core::raster::LabelImage;
use stonewise_simulate::{
    Day, FacePoint, PhotoParams, SceneParams, Studio, WallMotion, WallParams, World, disturb_views,
    plan_views, shown_part, true_labels,
};

fn params() -> (SceneParams, PhotoParams) {
    let scene = SceneParams {
        wall: WallParams::sized([1.8, 1.4]),
        motions: vec![WallMotion::Loose {
            share: 0.1,
            at_least: 2,
            shift_m: [0.02, 0.03],
            rotation_rad: 0.03,
        }],
        ..SceneParams::default()
    };
    let photos = PhotoParams {
        columns: 2,
        rows: 1,
        width: 480,
        height: 360,
        focal_px: 800.0,
        distance_m: 4.5,
        ..PhotoParams::default()
    };
    (scene, photos)
}

/// Label at a pixel and whether all pixels around it carry the same.
fn label(labels: &LabelImage, [x, y]: [f64; 2]) -> Option<(u32, bool)> {
    let own = *labels.at([x, y])?;
    let same =
        (-1..=1).all(|j| (-1..=1).all(|i| labels.at([x + f64::from(i), y + f64::from(j)]) == Some(&own)));
    Some((own, same))
}

#[test]
fn labels_under_projected_points_are_their_stones() {
    let (params, photos) = params();
    let world = World::new(&params);
    for epoch in [0, 1] {
        let scene = world.scene(epoch);
        let scan = world.scan(&params, epoch).tls.unwrap();
        let studio = Studio::new(&scene, &Day::new(3));
        for view in plan_views(&world.wall, &photos, epoch, 5) {
            let photo = studio.photograph(&view, &photos.sensor);
            let (mut right, mut all) = (0, 0);
            for i in (0..scan.len()).step_by(7) {
                let point = scan.cloud.origin() + nalgebra::Vector3::from(scan.exact[i]).cast::<f64>();
                let Some(projection) = view.project(&point) else {
                    continue;
                };
                let to = point - view.centre();
                let free = to.norm() - 0.01;
                let Some((own, true)) = label(&photo.labels, projection.pixel) else {
                    continue;
                };
                if scene.blocked(&view.centre(), &to.normalize(), free) {
                    continue;
                }
                all += 1;
                right += usize::from(own == scan.stone[i]);
            }
            assert!(all > 2000, "{all}");
            assert!(right * 1000 >= all * 995, "{right} of {all}");
        }
    }
}

#[test]
fn a_part_of_the_wall_is_enough_for_a_photo_that_shows_no_more() {
    let (mut params, mut photos) = params();
    params.wall.width_m = 8.0;
    photos.columns = 3;
    let world = World::new(&params);
    let view = &plan_views(&world.wall, &photos, 0, 5)[0];
    let part = shown_part(&world.wall, view).unwrap();
    assert!(part[1] < 3.0, "the photo at the left end shows {part:?}");
    let surface = world.surface(part);
    let labels = true_labels(&world.scene_of(&surface, 0), view);
    let whole = true_labels(&world.scene(0), view);
    let same = labels
        .data()
        .iter()
        .zip(whole.data())
        .filter(|(a, b)| a == b)
        .count();
    assert!(same * 1000 >= labels.data().len() * 999, "{same}");
    let photo = Studio::new(&world.scene(0), &Day::new(3)).photograph(view, &photos.sensor);
    assert_eq!(photo.labels, whole);
}

#[test]
fn every_part_of_a_tall_wall_is_in_a_photo() {
    let scene = SceneParams {
        wall: WallParams {
            width_m: 12.0,
            height_m: 16.0,
            course_m: 1.5,
            ..WallParams::default()
        },
        ..SceneParams::default()
    };
    // A photo shows 5 x 4 m.
    let photos = PhotoParams {
        columns: 4,
        rows: 6,
        width: 500,
        height: 400,
        focal_px: 400.0,
        distance_m: 4.0,
        ..PhotoParams::default()
    };
    let wall = World::new(&scene).wall;
    let views = plan_views(&wall, &photos, 0, 1);
    for k in 0..49 * 65 {
        let (a, u) = (0.25 * f64::from(k % 49) - 6.0, 0.25 * f64::from(k / 49));
        let place = wall.face.world_of(&FacePoint { a, u, n: 0.0 });
        let inside = |view: &View| {
            let pixel = view.project(&place)?.pixel;
            (0.0 <= pixel[0] && pixel[0] < 500.0 && 0.0 <= pixel[1] && pixel[1] < 400.0).then_some(())
        };
        assert!(views.iter().any(|v| inside(v).is_some()), "{a} {u}");
    }
}

#[test]
fn photos_are_exposed_and_do_not_depend_on_threads() {
    let (params, photos) = params();
    let world = World::new(&params);
    let scene = world.scene(0);
    let take = |threads: usize| {
        stonewise_testing::on_threads(threads, || {
            let views = plan_views(&world.wall, &photos, 0, 5);
            Studio::new(&scene, &Day::new(3)).photograph(&views[0], &photos.sensor)
        })
    };
    let (one, two) = (take(1), take(2));
    assert_eq!(one.image, two.image);
    assert_eq!(one.labels, two.labels);
    let data = one.image.data();
    let mean = data.iter().map(|p| f64::from(p[1])).sum::<f64>() / data.len() as f64;
    assert!((70.0..190.0).contains(&mean), "{mean}");
}

#[test]
fn delivered_poses_are_off_by_the_stated_pixels() {
    let (params, photos) = params();
    let photos = PhotoParams {
        columns: 20,
        rows: 20,
        ..photos
    };
    let world = World::new(&params);
    let exact = plan_views(&world.wall, &photos, 0, 5);
    let off = |a: &View, b: &View| {
        let (from, along) = a.ray(a.camera.center_px).unwrap();
        let p = b.project(&(from + along * photos.distance_m)).unwrap().pixel;
        (p[0] - a.camera.center_px[0]).powi(2) + (p[1] - a.camera.center_px[1]).powi(2)
    };
    let delivered = disturb_views(&exact, &photos, 9);
    let squares: f64 = exact.iter().zip(&delivered).map(|(a, b)| off(a, b)).sum();
    // Per image axis.
    let rms = (squares / (2.0 * exact.len() as f64)).sqrt();
    assert!((rms / photos.pose_noise_px - 1.0).abs() < 0.1, "{rms}");
}
