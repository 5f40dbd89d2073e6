//! What the detector runs on.

use burn::backend::Autodiff;
use burn::tensor::Device;

/// libtorch, where the program was built with the feature `tch`.
#[cfg(feature = "tch")]
pub type Compute = burn::backend::LibTorch;
/// burn's pure Rust backend on the CPU.
#[cfg(not(feature = "tch"))]
pub type Compute = burn::backend::Flex;

/// The same, keeping track of gradients.
pub type Training = Autodiff<Compute>;

/// Whether a GPU, where there is one, would be used.
pub fn can_use_gpu() -> bool {
    cfg!(feature = "tch")
}

/// The first GPU if there is one, else the CPU.
#[cfg(feature = "tch")]
pub fn device() -> Device<Compute> {
    use burn::backend::libtorch::LibTorchDevice;
    if tch::Cuda::is_available() {
        LibTorchDevice::Cuda(0)
    } else {
        LibTorchDevice::Cpu
    }
}

/// The CPU.
#[cfg(not(feature = "tch"))]
pub fn device() -> Device<Compute> {
    Device::<Compute>::default()
}
