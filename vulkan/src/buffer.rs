//! Memory that the host or the device reads and writes. Knows which kind of memory serves whom; knows nothing of what is
//! in it.

use std::sync::Arc;

use ash::vk::{self, BufferUsageFlags as Usage, MemoryPropertyFlags as Memory};

use crate::VulkanError;
use crate::device::{Core, Owned};

/// Who reads and writes a buffer beside the device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Access {
    /// The host writes it.
    Write,
    /// The host writes it, for the device to copy.
    Stage,
    /// The host reads it.
    Read,
    /// Nobody.
    Device,
}

impl Access {
    /// What memory there must be, at least, and then what is best, the best last. Memory that is visible and coherent is
    /// there for every buffer, as Vulkan promises.
    const fn wishes(self) -> (Memory, [Memory; 2]) {
        let host = Memory::from_raw(Memory::HOST_VISIBLE.as_raw() | Memory::HOST_COHERENT.as_raw());
        match self {
            Self::Write => (host, [Memory::HOST_CACHED, Memory::DEVICE_LOCAL]),
            Self::Stage => (host, [Memory::empty(), Memory::HOST_CACHED]),
            // Reading memory that is not cached is slower than anything else.
            Self::Read => (host, [Memory::DEVICE_LOCAL, Memory::HOST_CACHED]),
            Self::Device => (Memory::empty(), [Memory::empty(), Memory::DEVICE_LOCAL]),
        }
    }
}

/// Kinds of memory that are for those who enabled them.
const SPECIAL: Memory = Memory::from_raw(
    Memory::PROTECTED.as_raw()
        | Memory::LAZILY_ALLOCATED.as_raw()
        | Memory::DEVICE_COHERENT_AMD.as_raw()
        | Memory::DEVICE_UNCACHED_AMD.as_raw(),
);

/// A buffer with memory of its own.
pub(crate) struct Buffer {
    // The buffer goes before its memory.
    buffer: Owned<vk::Buffer>,
    memory: Owned<vk::DeviceMemory>,
    size: u64,
    access: Access,
    core: Arc<Core>,
}

impl Buffer {
    fn new(core: &Arc<Core>, size: u64, usage: Usage, access: Access) -> Result<Self, VulkanError> {
        let create = vk::BufferCreateInfo::default().size(size).usage(usage).sharing_mode(vk::SharingMode::EXCLUSIVE);
        // SAFETY: the size is not 0. What is made goes to an owner at once, with the call that destroys its kind.
        let (buffer, needs) = unsafe {
            let buffer = core.raw.create_buffer(&create, None).map_err(|result| out_of(size, result))?;
            let buffer = Owned::new(core, buffer, |device, buffer| device.destroy_buffer(buffer, None));
            let needs = core.raw.get_buffer_memory_requirements(buffer.handle);
            (buffer, needs)
        };
        let index = memory_type(&core.memory, needs.memory_type_bits, access).ok_or_else(|| {
            VulkanError::Unsupported(format!("{} has no memory that the host can read and write", core.info.name))
        })?;
        let allocate = vk::MemoryAllocateInfo::default().allocation_size(needs.size).memory_type_index(index);
        // SAFETY: the memory's type is one of the device's; buffer and memory are not bound yet, and it is as large and of
        // the kind that the buffer needs. It goes to an owner as well, and is mapped in `with` alone.
        let memory = unsafe {
            let memory = core.raw.allocate_memory(&allocate, None).map_err(|result| out_of(needs.size, result))?;
            let memory = Owned::new(core, memory, |device, memory| device.free_memory(memory, None));
            core.raw
                .bind_buffer_memory(buffer.handle, memory.handle, 0)
                .map_err(VulkanError::call("binding memory"))?;
            memory
        };
        Ok(Self { buffer, memory, size, access, core: Arc::clone(core) })
    }

    pub(crate) const fn handle(&self) -> vk::Buffer {
        self.buffer.handle
    }

    /// Works on the first bytes of a buffer that the host may write or read.
    pub(crate) fn with<T>(&mut self, bytes: u64, work: impl FnOnce(&mut [u8]) -> T) -> Result<T, VulkanError> {
        let length = usize::try_from(bytes).ok().filter(|_| bytes <= self.size && self.access != Access::Device);
        let length = length.ok_or_else(|| VulkanError::Failed("a buffer is not as large as its content".to_owned()))?;
        // SAFETY: the memory is host-visible and coherent, not mapped already, and has `size` bytes from its start on;
        // the mapping ends before `self` is free again. The device does not use it meanwhile, for every submission is
        // waited for. Bytes that nobody wrote are some bytes, as memory of another process's making.
        unsafe {
            let start = self
                .core
                .raw
                .map_memory(self.memory.handle, 0, vk::WHOLE_SIZE, vk::MemoryMapFlags::empty())
                .map_err(VulkanError::call("reading its memory"))?;
            let result = work(std::slice::from_raw_parts_mut(start.cast::<u8>(), length));
            self.core.raw.unmap_memory(self.memory.handle);
            Ok(result)
        }
    }
}

/// A buffer that a kernel uses and the host fills or reads: one and the same, or two of which one is the device's own.
/// It grows as needed.
pub(crate) struct Shared {
    usage: Usage,
    access: Access,
    staged: bool,
    pair: Option<Pair>,
}

struct Pair {
    host: Buffer,
    local: Option<Buffer>,
}

impl Shared {
    pub(crate) const fn new(usage: Usage, access: Access, staged: bool) -> Self {
        Self { usage, access, staged, pair: None }
    }

    /// Makes it hold this many bytes. What was in it may be lost.
    pub(crate) fn reserve(&mut self, core: &Arc<Core>, bytes: u64) -> Result<(), VulkanError> {
        const STEP: u64 = 1 << 16;
        if self.pair.as_ref().is_some_and(|pair| pair.host.size >= bytes) {
            return Ok(());
        }
        let size = bytes.max(1).checked_next_multiple_of(STEP).ok_or(VulkanError::Memory { bytes })?;
        // The old one goes first, so that there is room.
        self.pair = None;
        let (host, copied, local) = match self.access {
            Access::Read => (Access::Read, Usage::TRANSFER_DST, Usage::TRANSFER_SRC),
            _ => (Access::Stage, Usage::TRANSFER_SRC, Usage::TRANSFER_DST),
        };
        self.pair = Some(if self.staged {
            let local = Buffer::new(core, size, self.usage | local, Access::Device)?;
            Pair { host: Buffer::new(core, size, copied, host)?, local: Some(local) }
        } else {
            Pair { host: Buffer::new(core, size, self.usage, self.access)?, local: None }
        });
        Ok(())
    }

    /// What the kernel uses; null before anything is reserved.
    pub(crate) fn kernel(&self) -> vk::Buffer {
        self.pair.as_ref().map_or_else(vk::Buffer::null, |p| p.local.as_ref().unwrap_or(&p.host).handle())
    }

    /// The host's buffer and the device's own, where they are two.
    pub(crate) fn stages(&self) -> Option<(vk::Buffer, vk::Buffer)> {
        self.pair.as_ref().and_then(|p| p.local.as_ref().map(|local| (p.host.handle(), local.handle())))
    }

    /// Works on its first bytes as the host sees them.
    pub(crate) fn with<T>(&mut self, bytes: u64, work: impl FnOnce(&mut [u8]) -> T) -> Result<T, VulkanError> {
        match &mut self.pair {
            Some(pair) => pair.host.with(bytes, work),
            None => Ok(work(&mut [])),
        }
    }
}

/// The place of the best memory for an access among those that a buffer may have.
fn memory_type(all: &vk::PhysicalDeviceMemoryProperties, allowed: u32, access: Access) -> Option<u32> {
    let (must, wishes) = access.wishes();
    let has = |flags: Memory, wish: Memory, rank: u32| if flags.contains(wish) { rank } else { 0 };
    let types = all.memory_types.iter().take(all.memory_type_count as usize);
    (0_u32..)
        .zip(types)
        .filter(|(index, kind)| allowed & (1 << index) != 0 && kind.property_flags.contains(must))
        .filter(|(_, kind)| !kind.property_flags.intersects(SPECIAL))
        .map(|(index, kind)| {
            let [good, best] = wishes;
            (has(kind.property_flags, good, 1) + has(kind.property_flags, best, 2), index)
        })
        // Of equals the first: devices list the faster first.
        .reduce(|best, next| if next.0 > best.0 { next } else { best })
        .map(|(_, index)| index)
}

fn out_of(bytes: u64, result: vk::Result) -> VulkanError {
    match result {
        vk::Result::ERROR_OUT_OF_DEVICE_MEMORY | vk::Result::ERROR_OUT_OF_HOST_MEMORY => VulkanError::Memory { bytes },
        other => VulkanError::call("allocating memory")(other),
    }
}
