//! An opened device, and the owner of everything that is made of it. Knows what outlives what; knows nothing of kernels.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use ash::vk;
use isograd_compiler::{Artefact, Manifest};

use crate::dispatch::Session;
use crate::instance::{Found, Instance};
use crate::{Choice, DeviceInfo, Settings, Shader, VulkanError};

/// An opened device. It evaluates one call after the other, from whatever threads they come.
pub struct Device {
    /// What evaluations use one after the other: queue, commands, buffers.
    session: Mutex<Session>,
    settings: Settings,
    core: Arc<Core>,
}

/// The device itself. Everything made of it is an [`Owned`] and holds it, so that it is destroyed last.
pub(crate) struct Core {
    pub(crate) raw: ash::Device,
    pub(crate) info: DeviceInfo,
    pub(crate) limits: vk::PhysicalDeviceLimits,
    pub(crate) memory: vk::PhysicalDeviceMemoryProperties,
    /// Bits of a timestamp that count; none if the queue has no timestamps.
    pub(crate) timestamp_bits: u32,
    /// Set when the device may still be at work on something that it was given: nothing may be destroyed any more.
    abandoned: AtomicBool,
    /// Destroyed after the device.
    instance: Instance,
}

/// Something made of a device, with the call that destroys it.
pub(crate) struct Owned<T: Copy> {
    pub(crate) handle: T,
    destroy: unsafe fn(&ash::Device, T),
    core: Arc<Core>,
}

impl<T: Copy> Owned<T> {
    /// Takes what Vulkan made.
    ///
    /// # Safety
    /// It was made of this device and has no other owner, and `destroy` is the call that destroys its kind.
    pub(crate) unsafe fn new(core: &Arc<Core>, handle: T, destroy: unsafe fn(&ash::Device, T)) -> Self {
        Self { handle, destroy, core: Arc::clone(core) }
    }
}

impl<T: Copy> Drop for Owned<T> {
    fn drop(&mut self) {
        if !self.core.abandoned.load(Ordering::Relaxed) {
            // SAFETY: the device is alive, for `core` holds it; this is the only owner of the handle; and the device
            // does not work on it, for every submission is waited for, or else the device is abandoned.
            unsafe { (self.destroy)(&self.core.raw, self.handle) };
        }
    }
}

impl Core {
    fn open(instance: Instance, found: Found) -> Result<Self, VulkanError> {
        let (family, timestamp_bits) = found.family;
        let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(family).queue_priorities(&[1.0])];
        let doubles = found.info.doubles;
        let features = vk::PhysicalDeviceFeatures::default().shader_float64(doubles).shader_int64(doubles);
        let create = vk::DeviceCreateInfo::default().queue_create_infos(&queues).enabled_features(&features);
        // SAFETY: the device and the queue family are of this instance, and has the features, as was asked.
        let (raw, memory) = unsafe {
            let raw = instance
                .raw
                .create_device(found.physical, &create, None)
                .map_err(VulkanError::call("opening the device"))?;
            (raw, instance.raw.get_physical_device_memory_properties(found.physical))
        };
        let abandoned = AtomicBool::new(false);
        Ok(Self { raw, info: found.info, limits: found.limits, memory, timestamp_bits, abandoned, instance })
    }

    /// Gives up a device that does not stop: neither it nor anything made of it is destroyed, now or ever, for it may
    /// use them still.
    pub(crate) fn abandon(self: &Arc<Self>) {
        if !self.abandoned.swap(true, Ordering::Relaxed) {
            std::mem::forget(Arc::clone(self));
        }
    }
}

impl Drop for Core {
    fn drop(&mut self) {
        // SAFETY: all that was made of the device is gone, for it held this. An abandoned device never comes here.
        unsafe { self.raw.destroy_device(None) };
    }
}

impl Device {
    /// Opens a device.
    ///
    /// # Errors
    /// If there is no Vulkan, no such device, or no validation layer where one is asked for.
    pub fn open(choice: &Choice) -> Result<Self, VulkanError> {
        Self::open_with(choice, Settings::default())
    }

    /// Opens a device that may take no more than this for a call.
    ///
    /// # Errors
    /// As [`Device::open`].
    pub fn open_with(choice: &Choice, settings: Settings) -> Result<Self, VulkanError> {
        let instance = Instance::new(choice.validation)?;
        let found = instance.choose(choice)?;
        let family = found.family.0;
        let core = Arc::new(Core::open(instance, found)?);
        let session = Mutex::new(Session::new(&core, family, &settings)?);
        Ok(Self { session, settings, core })
    }

    /// What device it is.
    #[must_use]
    pub fn info(&self) -> &DeviceInfo {
        &self.core.info
    }

    /// What the validation layer said so far, warnings and errors; nothing if it was not asked for.
    #[must_use]
    pub fn messages(&self) -> Vec<String> {
        self.core.instance.messages()
    }

    /// Makes a shader of an artefact of the target `spirv` and the form `kernel`.
    ///
    /// # Errors
    /// If it is another kind of artefact, or the device cannot run it.
    pub fn load(&self, artefact: &Artefact) -> Result<Shader<'_>, VulkanError> {
        self.load_bytes(&artefact.bytes, &artefact.manifest)
    }

    /// Makes a shader of a module as it lies in a file, and its manifest. What the compiler wrote is trusted to be valid
    /// SPIR-V and to keep to its buffers: no driver checks that, and a module of doubtful origin can do anything that
    /// the driver lets it do.
    ///
    /// # Errors
    /// If it is another kind of artefact, or the device cannot run it.
    pub fn load_bytes(&self, bytes: &[u8], manifest: &Manifest) -> Result<Shader<'_>, VulkanError> {
        Shader::new(self, bytes, manifest)
    }

    pub(crate) const fn core(&self) -> &Arc<Core> {
        &self.core
    }

    pub(crate) const fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Has what evaluations use to itself, after those who came before.
    pub(crate) fn with_session<T>(
        &self,
        work: impl FnOnce(&mut Session) -> Result<T, VulkanError>,
    ) -> Result<T, VulkanError> {
        work(&mut self.session.lock().unwrap_or_else(PoisonError::into_inner))
    }
}
