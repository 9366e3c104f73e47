//! The loader of Vulkan, the devices it finds, and what its validation layer says about us. Knows nothing of kernels.

use std::ffi::{CStr, c_void};
use std::sync::{Mutex, PoisonError};

use ash::{Entry, ext, khr, vk};

use crate::{Choice, DeviceInfo, DeviceKind, VulkanError};

const LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";

/// SPIR-V 1.3 needs Vulkan 1.1, and no more is used.
pub(crate) const API: u32 = vk::API_VERSION_1_1;

/// What the validation layer said.
#[derive(Default)]
struct Log(Mutex<Vec<String>>);

/// The loader and an instance.
pub(crate) struct Instance {
    pub(crate) raw: ash::Instance,
    messenger: Option<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    /// In a box of its own, for the messenger holds its address.
    log: Box<Log>,
    /// The library; it is closed after the instance is destroyed.
    _entry: Entry,
}

/// A device that could be opened.
pub(crate) struct Found {
    pub(crate) physical: vk::PhysicalDevice,
    pub(crate) info: DeviceInfo,
    pub(crate) limits: vk::PhysicalDeviceLimits,
    /// A queue family that computes, and whether its timestamps count: their bits.
    pub(crate) family: (u32, u32),
}

/// The devices of this machine that can evaluate kernels, the preferred ones first.
///
/// # Errors
/// If there is no Vulkan.
pub fn devices() -> Result<Vec<DeviceInfo>, VulkanError> {
    let instance = Instance::new(false)?;
    Ok(instance.find()?.into_iter().map(|found| found.info).collect())
}

impl Instance {
    pub(crate) fn new(validation: bool) -> Result<Self, VulkanError> {
        // SAFETY: the library is the system's loader of Vulkan, whose initialisation has no preconditions.
        let entry = unsafe { Entry::load() }.map_err(|e| VulkanError::NoLoader(e.to_string()))?;
        // SAFETY: no preconditions.
        let version = unsafe { entry.try_enumerate_instance_version() }
            .map_err(VulkanError::call("asking for its version"))?
            .unwrap_or(vk::API_VERSION_1_0);
        if version < API {
            return Err(VulkanError::NoLoader("it is Vulkan 1.0, and 1.1 is needed".to_owned()));
        }
        if validation && !has_layer(&entry)? {
            return Err(VulkanError::Validation);
        }
        let log = Box::<Log>::default();
        let application = vk::ApplicationInfo::default().application_name(c"isograd").api_version(API);
        let mut info = vk::InstanceCreateInfo::default().application_info(&application);
        let layers = [LAYER.as_ptr()];
        let mut extensions = vec![ext::debug_utils::NAME.as_ptr()];
        let mut watch = messages(&log);
        let enabled = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
        let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&enabled);
        if validation {
            // Layers of some years ago cannot be told to look for missing barriers.
            if layer_has(&entry, ext::validation_features::NAME)? {
                extensions.push(ext::validation_features::NAME.as_ptr());
                info = info.push_next(&mut features);
            }
            info = info.enabled_layer_names(&layers).enabled_extension_names(&extensions).push_next(&mut watch);
        }
        // SAFETY: all that `info` points to lives until the end of this function; what `watch` points to, the log, as
        // long as the instance.
        let raw = unsafe { entry.create_instance(&info, None) }.map_err(|result| match result {
            vk::Result::ERROR_INCOMPATIBLE_DRIVER => none_at_all(),
            other => VulkanError::call("starting")(other),
        })?;
        let mut instance = Self { raw, messenger: None, log, _entry: entry };
        if validation {
            let debug = ext::debug_utils::Instance::new(&instance._entry, &instance.raw);
            // SAFETY: the extension is enabled, and the log outlives the messenger: `drop` destroys that first.
            let messenger = unsafe { debug.create_debug_utils_messenger(&messages(&instance.log), None) }
                .map_err(VulkanError::call("listening to the validation layer"))?;
            instance.messenger = Some((debug, messenger));
        }
        Ok(instance)
    }

    /// What the validation layer said so far.
    pub(crate) fn messages(&self) -> Vec<String> {
        self.log.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// The devices that compute, the preferred ones first.
    pub(crate) fn find(&self) -> Result<Vec<Found>, VulkanError> {
        // SAFETY: the instance is alive.
        let all = unsafe { self.raw.enumerate_physical_devices() }.map_err(VulkanError::call("looking for devices"))?;
        let mut found: Vec<Found> = all.into_iter().filter_map(|device| self.inspect(device)).collect();
        found.sort_by_key(|found| found.info.kind);
        Ok(found)
    }

    /// The device that is meant.
    pub(crate) fn choose(&self, choice: &Choice) -> Result<Found, VulkanError> {
        let found = self.find()?;
        let infos: Vec<&DeviceInfo> = found.iter().map(|found| &found.info).collect();
        let place = place(&infos, choice.device.as_deref())?;
        found.into_iter().nth(place).ok_or_else(none_at_all)
    }

    /// What is to be known of a device, if it can evaluate kernels.
    fn inspect(&self, physical: vk::PhysicalDevice) -> Option<Found> {
        // SAFETY: the device is one of this instance's. The properties of drivers are asked for only where the device
        // has the extension that they belong to.
        let (properties, features, families, driver) = unsafe {
            let named = self
                .raw
                .enumerate_device_extension_properties(physical)
                .ok()?
                .iter()
                .any(|e| e.extension_name_as_c_str() == Ok(khr::driver_properties::NAME));
            let mut driver = vk::PhysicalDeviceDriverProperties::default();
            let first = self.raw.get_physical_device_properties(physical);
            if first.api_version < API {
                return None;
            }
            if named {
                let mut all = vk::PhysicalDeviceProperties2::default().push_next(&mut driver);
                self.raw.get_physical_device_properties2(physical, &mut all);
            }
            let features = self.raw.get_physical_device_features(physical);
            let families = self.raw.get_physical_device_queue_family_properties(physical);
            (first, features, families, named.then_some(driver))
        };
        let computes = |family: &vk::QueueFamilyProperties| family.queue_flags.contains(vk::QueueFlags::COMPUTE);
        let (index, family) = (0..).zip(&families).find(|(_, family)| computes(family))?;
        let text = |text: Result<&CStr, _>| text.map_or_else(|_| String::new(), |t| t.to_string_lossy().into_owned());
        let driver = match driver {
            Some(d) => format!("{} {}", text(d.driver_name_as_c_str()), text(d.driver_info_as_c_str())),
            None => format!("driver {:#x}", properties.driver_version),
        };
        let api = properties.api_version;
        let info = DeviceInfo {
            name: text(properties.device_name_as_c_str()),
            kind: match properties.device_type {
                vk::PhysicalDeviceType::DISCRETE_GPU => DeviceKind::Discrete,
                vk::PhysicalDeviceType::INTEGRATED_GPU => DeviceKind::Integrated,
                vk::PhysicalDeviceType::VIRTUAL_GPU => DeviceKind::Virtual,
                vk::PhysicalDeviceType::CPU => DeviceKind::Cpu,
                _ => DeviceKind::Other,
            },
            driver: driver.trim().to_owned(),
            api: format!(
                "{}.{}.{}",
                vk::api_version_major(api),
                vk::api_version_minor(api),
                vk::api_version_patch(api)
            ),
            doubles: features.shader_float64 == vk::TRUE && features.shader_int64 == vk::TRUE,
            max_buffer: u64::from(properties.limits.max_storage_buffer_range),
            max_groups: properties.limits.max_compute_work_group_count[0],
        };
        let family = (index, family.timestamp_valid_bits);
        Some(Found { physical, info, limits: properties.limits, family })
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        // SAFETY: everything made of the instance is gone, for its owners hold the instance; each is destroyed once.
        unsafe {
            if let Some((debug, messenger)) = self.messenger.take() {
                debug.destroy_debug_utils_messenger(messenger, None);
            }
            self.raw.destroy_instance(None);
        }
    }
}

/// The place of the device that is meant among those there are, which are in the order of preference.
fn place(infos: &[&DeviceInfo], wanted: Option<&str>) -> Result<usize, VulkanError> {
    if infos.is_empty() {
        return Err(none_at_all());
    }
    let Some(wanted) = wanted else { return Ok(0) };
    let lower = wanted.to_lowercase();
    let kind = DeviceKind::ALL.into_iter().find(|kind| kind.name() == lower);
    let meant = |info: &&DeviceInfo| match kind {
        Some(kind) => info.kind == kind,
        None => info.name.to_lowercase().contains(&lower),
    };
    infos.iter().position(meant).ok_or_else(|| {
        let names: Vec<String> =
            infos.iter().map(|info| format!("`{}` ({}, {})", info.name, info.kind.name(), info.driver)).collect();
        VulkanError::NoDevice(format!("no Vulkan device is called `{wanted}`; there is {}", names.join(", ")))
    })
}

fn none_at_all() -> VulkanError {
    VulkanError::NoDevice(
        "there is no Vulkan device; install a driver (on Debian and Ubuntu, for the processor as well: apt-get install \
         mesa-vulkan-drivers)"
            .to_owned(),
    )
}

fn has_layer(entry: &Entry) -> Result<bool, VulkanError> {
    // SAFETY: no preconditions.
    let layers = unsafe { entry.enumerate_instance_layer_properties() }
        .map_err(VulkanError::call("looking for the validation layer"))?;
    Ok(layers.iter().any(|layer| layer.layer_name_as_c_str() == Ok(LAYER)))
}

fn layer_has(entry: &Entry, name: &CStr) -> Result<bool, VulkanError> {
    // SAFETY: the layer exists.
    let extensions = unsafe { entry.enumerate_instance_extension_properties(Some(LAYER)) }
        .map_err(VulkanError::call("asking the validation layer what it can do"))?;
    Ok(extensions.iter().any(|extension| extension.extension_name_as_c_str() == Ok(name)))
}

/// Listens to the layer alone: the loader's own messages are of the type `GENERAL`, as on drivers for other hardware.
fn messages(log: &Log) -> vk::DebugUtilsMessengerCreateInfoEXT<'_> {
    use vk::{DebugUtilsMessageSeverityFlagsEXT as Severity, DebugUtilsMessageTypeFlagsEXT as Type};
    vk::DebugUtilsMessengerCreateInfoEXT::default()
        .message_severity(Severity::WARNING | Severity::ERROR)
        .message_type(Type::VALIDATION | Type::PERFORMANCE)
        .pfn_user_callback(Some(note))
        .user_data(std::ptr::from_ref(log).cast::<c_void>().cast_mut())
}

/// Notes what the layer says. It may be called from any thread.
unsafe extern "system" fn note(
    severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    _: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    log: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: Vulkan hands over what `messages` registered, a log that outlives the messenger and is only shared, and
    // message data that is valid during the call.
    unsafe {
        if let (Some(log), Some(data)) = (log.cast::<Log>().as_ref(), data.as_ref()) {
            let error = severity.contains(vk::DebugUtilsMessageSeverityFlagsEXT::ERROR);
            let text = data.message_as_c_str().unwrap_or_default().to_string_lossy();
            let message = format!("{}: {text}", if error { "error" } else { "warning" });
            log.0.lock().unwrap_or_else(PoisonError::into_inner).push(message);
        }
    }
    vk::FALSE
}

#[cfg(test)]
mod tests {
    use super::*;

    fn info(name: &str, kind: DeviceKind) -> DeviceInfo {
        DeviceInfo {
            name: name.to_owned(),
            kind,
            driver: "test".to_owned(),
            api: "1.1.0".to_owned(),
            doubles: true,
            max_buffer: 1 << 27,
            max_groups: 65_535,
        }
    }

    #[test]
    fn devices_are_chosen_by_kind_and_by_name() {
        let (card, chip, program) = (
            info("NVIDIA H200", DeviceKind::Discrete),
            info("Intel(R) Xe", DeviceKind::Integrated),
            info("llvmpipe (LLVM 15.0.6, 256 bits)", DeviceKind::Cpu),
        );
        let all = [&card, &chip, &program];
        assert_eq!(place(&all, None), Ok(0));
        for (wanted, at) in [("cpu", 2), ("CPU", 2), ("LLVMpipe", 2), ("integrated", 1), ("xe", 1), ("h200", 0)] {
            assert_eq!(place(&all, Some(wanted)), Ok(at), "{wanted}");
        }
        let Err(VulkanError::NoDevice(text)) = place(&all, Some("radeon")) else { panic!("there is no radeon") };
        for part in ["`radeon`", "`NVIDIA H200` (discrete, test)", "`Intel(R) Xe` (integrated", "`llvmpipe"] {
            assert!(text.contains(part), "{text}");
        }
        // A kind is not looked for in names.
        assert!(matches!(place(&all, Some("virtual")), Err(VulkanError::NoDevice(_))));
        let Err(VulkanError::NoDevice(text)) = place(&[], Some("cpu")) else { panic!("there is none") };
        assert!(text.contains("apt-get install"), "{text}");
    }
}
