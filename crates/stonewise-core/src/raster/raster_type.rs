//! A row-major grid of values.

/// A row-major image; pixel (x, y) covers [x, x+1) x [y, y+1) in pixel coordinates.
#[derive(Clone, Debug, PartialEq)]
pub struct Raster<T> {
    width: u32,
    height: u32,
    data: Vec<T>,
}

/// Distance along the view axis, metres; infinite where nothing was seen.
pub type DepthMap = Raster<f32>;
/// Red, green, blue.
pub type RgbImage = Raster<[u8; 3]>;
/// Instance per pixel; 0 is background.
pub type LabelImage = Raster<u32>;

impl<T: Clone> Raster<T> {
    /// An image full of one value.
    pub fn filled(width: u32, height: u32, value: T) -> Self {
        Self {
            width,
            height,
            data: vec![value; width as usize * height as usize],
        }
    }
}

impl<T> Raster<T> {
    /// An image from its rows; `None` unless `data` holds exactly `width * height` values.
    pub fn from_vec(width: u32, height: u32, data: Vec<T>) -> Option<Self> {
        (data.len() == width as usize * height as usize).then_some(Self { width, height, data })
    }

    /// Width, pixels.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height, pixels.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// All values, row by row.
    pub fn data(&self) -> &[T] {
        &self.data
    }

    /// All values, row by row, to be changed.
    pub fn data_mut(&mut self) -> &mut [T] {
        &mut self.data
    }

    /// The value of a pixel; `None` outside.
    pub fn get(&self, x: u32, y: u32) -> Option<&T> {
        (x < self.width && y < self.height).then(|| &self.data[y as usize * self.width as usize + x as usize])
    }

    /// The value of a pixel, to be changed; `None` outside.
    pub fn get_mut(&mut self, x: u32, y: u32) -> Option<&mut T> {
        (x < self.width && y < self.height)
            .then(|| &mut self.data[y as usize * self.width as usize + x as usize])
    }

    /// The value under a pixel coordinate; `None` outside the image.
    pub fn at(&self, pixel: [f64; 2]) -> Option<&T> {
        let inside = pixel[0] >= 0.0 && pixel[1] >= 0.0;
        inside
            .then(|| self.get(pixel[0] as u32, pixel[1] as u32))
            .flatten()
    }
}
