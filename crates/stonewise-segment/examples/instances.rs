//! Writes what a model with torchvision's weights finds in images, as JSON, and how long it took: `instances
//! WEIGHTS.safetensors OUT.json IMAGE...`. testdata/mask_rcnn/compare_photos.py compares it with torchvision.
#![allow(clippy::expect_used, clippy::print_stdout)]

use burn::backend::Flex;
use std::path::{Path, PathBuf};
use std::time::Instant;
use stonewise_core::raster::Raster;
use stonewise_segment::model::{MaskRcnn, MaskRcnnConfig, Norm, load_weights};

fn main() {
    let mut args = std::env::args_os().skip(1).map(PathBuf::from);
    let mut next = || args.next().expect("WEIGHTS OUT IMAGE...");
    let (weights, out) = (next(), next());
    let mut config = MaskRcnnConfig::torchvision_r50();
    config.backbone.norm = Norm::FrozenBatch { epsilon: 1e-5 };
    let model = MaskRcnn::<Flex>::zeros(&config, &Default::default()).expect("a valid preset");
    let model = load_weights(model, &weights)
        .expect("torchvision's weights")
        .for_inference();
    let mut photos = Vec::new();
    for path in args {
        let image = read(&path);
        let megapixels = f64::from(image.width()) * f64::from(image.height()) * 1e-6;
        let start = Instant::now();
        let found = model.instances(&image, None);
        let seconds = start.elapsed().as_secs_f64();
        println!(
            "{}: {} objects, {seconds:.2} s, {:.2} s/MP",
            path.display(),
            found.len(),
            seconds / megapixels
        );
        let size = [image.width(), image.height()];
        let objects = found.iter().map(|instance| {
            let patch = stonewise_segment::model::paste_mask(&instance.mask, 28, instance.bounds, size);
            serde_json::json!({
                "bounds": instance.bounds, "class": instance.class, "score": instance.score, "mask": instance.mask,
                "left": patch.left, "top": patch.top, "width": patch.pixels.width(),
                "pixels": patch.pixels.data().iter().map(|&inside| u8::from(inside)).collect::<Vec<_>>(),
            })
        });
        photos.push(serde_json::Value::Array(objects.collect()));
    }
    std::fs::write(out, serde_json::to_vec(&photos).expect("numbers")).expect("a writable file");
}

fn read(path: &Path) -> Raster<[u8; 3]> {
    let image = image::open(path).expect("an image").into_rgb8();
    let pixels = image.pixels().map(|pixel| pixel.0).collect();
    Raster::from_vec(image.width(), image.height(), pixels).expect("as many pixels as rows times columns")
}
