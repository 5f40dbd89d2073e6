//! The picture while it is painted: surfaces first, light afterwards.

/// Row-major grids of equal size, finer than the photo by `scale`.
pub(super) struct Canvas {
    pub(super) width: usize,
    pub(super) height: usize,
    /// Samples per pixel of the photo along an axis.
    pub(super) scale: f32,
    /// Reflected share of red, green and blue light, linear.
    pub(super) albedo: Vec<[f32; 3]>,
    /// Height above the wall, pixels of the photo.
    pub(super) relief: Vec<f32>,
    /// Share of the sky's light that arrives, 0 to 1.
    pub(super) openness: Vec<f32>,
    /// The sun's strength over that on a surface that faces the camera: below 1 on walls turned away from it.
    pub(super) facing: Vec<f32>,
    /// True in the sky, where no shadow falls and no dirt lies.
    pub(super) sky: Vec<bool>,
    /// Stone, 0 where there is none.
    pub(super) label: Vec<u32>,
    /// True where a person could not say what is there.
    pub(super) doubtful: Vec<bool>,
    /// What was painted there last: 0 nothing, then the layers, then the objects.
    pub(super) piece: Vec<u8>,
    /// What is painted now.
    pub(super) current: u8,
    /// Number of stones so far: the largest label.
    pub(super) stones: u32,
}

impl Canvas {
    /// An empty canvas for a photo of `width` x `height` pixels.
    pub(super) fn new(width: u32, height: u32, scale: f32) -> Self {
        let samples = |pixels: u32| ((pixels as f32 * scale).ceil() as usize).max(1);
        let (width, height) = (samples(width), samples(height));
        let count = width * height;
        Self {
            width,
            height,
            scale,
            albedo: vec![[0.0; 3]; count],
            relief: vec![0.0; count],
            openness: vec![1.0; count],
            facing: vec![1.0; count],
            sky: vec![false; count],
            label: vec![0; count],
            doubtful: vec![false; count],
            piece: vec![0; count],
            current: 0,
            stones: 0,
        }
    }

    /// Photo coordinates of a sample's centre.
    #[inline]
    pub(super) fn photo(&self, x: usize, y: usize) -> [f32; 2] {
        [(x as f32 + 0.5) / self.scale, (y as f32 + 0.5) / self.scale]
    }

    /// Width and height of the photo, pixels.
    pub(super) fn photo_size(&self) -> [f32; 2] {
        [self.width as f32 / self.scale, self.height as f32 / self.scale]
    }
}
