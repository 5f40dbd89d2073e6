use std::io::Write;
use std::time::Instant;
use stonewise_core::simulate::*;
fn main() {
    let mut p = SceneParams::default();
    p.uav = Some(UavParams::default());
    p.motions = vec![
        WallMotion::Bulge {
            centre_m: [0., 1.5],
            depth_m: 0.05,
            diameter_m: 2.25,
        },
        WallMotion::Loose {
            share: 0.03,
            at_least: 2,
            shift_m: [0.01, 0.03],
            rotation_rad: 0.03,
        },
    ];
    let t = Instant::now();
    let w = World::new(&p);
    println!("world {:?} stones {}", t.elapsed(), w.wall.stones.len());
    let mut areas: Vec<f64> = w.wall.stones.iter().map(|s| s.area_m2).collect();
    areas.sort_by(|a, b| a.total_cmp(b));
    println!(
        "areas {:?}",
        [0.1, 0.5, 0.9].map(|q| areas[(q * areas.len() as f64) as usize])
    );
    let t = Instant::now();
    let scene = w.scene(1);
    println!("scene {:?}", t.elapsed());
    let e = w.wall.extent();
    let (wd, ht) = (1200usize, 975usize);
    let mut img = vec![0u8; wd * ht * 3];
    let mut slopes = vec![];
    for j in 0..ht {
        for i in 0..wd {
            let a = e[0] + (e[1] - e[0]) * (i as f64 + 0.5) / wd as f64;
            let u = e[3] - (e[3] - e[2]) * (j as f64 + 0.5) / ht as f64;
            let c = match scene.on_face(a, u) {
                Some(h) => {
                    let l = nalgebra::Vector3::new(0.55, -0.5, 0.67);
                    let v = (h.normal.dot(&l).max(0.0) * 220.0) as u8;
                    if h.target.stone().is_some() {
                        let f = w.wall.face.frame(a);
                        slopes.push((
                            (h.normal.dot(&f.along) / h.normal.dot(&f.out)),
                            (h.normal.dot(&f.up) / h.normal.dot(&f.out)),
                        ));
                        [v, v, v]
                    } else {
                        [v, v / 2, v / 3]
                    }
                }
                None => [0, 0, 255],
            };
            img[(j * wd + i) * 3..][..3].copy_from_slice(&c);
        }
    }
    let rms = (slopes.iter().map(|s| s.0 * s.0).sum::<f64>() / slopes.len() as f64).sqrt();
    let mut ab: Vec<f64> = slopes.iter().map(|s| s.0.abs()).collect();
    ab.sort_by(|a, b| a.total_cmp(b));
    println!(
        "slope rms {rms} median abs {}, stone share {}",
        ab[ab.len() / 2],
        slopes.len() as f64 / (wd * ht) as f64
    );
    let mut f = std::fs::File::create("/tmp/simwork/face.ppm").unwrap();
    write!(f, "P6\n{wd} {ht}\n255\n").unwrap();
    f.write_all(&img).unwrap();
    let t = Instant::now();
    let s = w.scan(&p, 1);
    println!(
        "scan {:?} tls {} uav {}",
        t.elapsed(),
        s.tls.as_ref().unwrap().len(),
        s.uav.as_ref().unwrap().len()
    );
    let t = s.tls.unwrap();
    println!("on stones {}", t.stone.iter().filter(|&&s| s > 0).count());
}
