use std::io::Write;
use std::time::Instant;
use stonewise_core::simulate::*;
fn main() {
    let seed: u64 = std::env::args().nth(1).map_or(1, |s| s.parse().unwrap());
    let mut p = SceneParams::default();
    p.wall.seed = seed;
    let w = World::new(&p);
    let scene = w.scene(0);
    let t = Instant::now();
    let pp = PhotoParams::default();
    let views = plan_views(&scene, &pp, 0, seed);
    let st = Studio::new(&scene, seed + 3);
    println!("studio {:?}", t.elapsed());
    for k in [1usize, 4] {
        let t = Instant::now();
        let ph = st.photograph(&views[k], &pp.sensor);
        println!("photo {:?}", t.elapsed());
        let mut f = std::fs::File::create(format!("/tmp/simwork/p{k}.ppm")).unwrap();
        write!(f, "P6\n{} {}\n255\n", ph.image.width(), ph.image.height()).unwrap();
        f.write_all(&ph.image.data().concat()).unwrap();
        let mut f = std::fs::File::create(format!("/tmp/simwork/l{k}.bin")).unwrap();
        f.write_all(
            &ph.labels
                .data()
                .iter()
                .flat_map(|v| v.to_le_bytes())
                .collect::<Vec<u8>>(),
        )
        .unwrap();
    }
}
