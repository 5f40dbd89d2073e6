use burn::backend::Flex;
use stonewise_core::raster::{Raster, RgbImage};
use stonewise_segment::model::MaskRcnn;
fn main() {
    let model: MaskRcnn<Flex> = stonewise_segment::model::load_model(std::path::Path::new("crates/stonewise-segment/weights/built-in.safetensors"), &Default::default()).unwrap();
    for (w, h) in [(64u32, 96u32), (320, 320), (480, 640)] {
        for v in [0u8, 60, 128, 200, 255] {
            let image: RgbImage = Raster::filled(w, h, [v; 3]);
            let f = model.instances(&image);
            let good: Vec<_> = f.iter().filter(|i| i.score >= 0.5).collect();
            let border = good.iter().filter(|i| i.bounds[0] < 16.0 || i.bounds[1] < 16.0 || i.bounds[2] > w as f32 - 16.0 || i.bounds[3] > h as f32 - 16.0).count();
            let size: f32 = good.iter().map(|i| ((i.bounds[2]-i.bounds[0])*(i.bounds[3]-i.bounds[1])).sqrt()).sum::<f32>() / good.len().max(1) as f32;
            println!("{w}x{h} grey {v}: {} objects, {} with score >= 0.5, {} of them near the border, mean size {size:.0} px, best {:.2}, kept by detect {}", f.len(), good.len(), border, f.first().map_or(0.0, |i| i.score), model.detect(&image).len());
        }
    }
}
