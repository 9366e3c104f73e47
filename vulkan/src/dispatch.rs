//! The commands of one chunk of points, and what all evaluations of a device use one after the other. Knows sizes and
//! pipelines; knows nothing of columns.

use std::sync::Arc;

use ash::vk::{self, AccessFlags, PipelineStageFlags as Stage};

use crate::buffer::{Access, Shared};
use crate::device::{Core, Owned};
use crate::plan::DISPATCHES;
use crate::{DeviceKind, Settings, VulkanError};

/// Queue, commands and buffers. Whoever has it to himself may use them; between calls the device is at rest.
pub(crate) struct Session {
    pub(crate) inputs: Shared,
    pub(crate) outputs: Shared,
    pub(crate) uniforms: Shared,
    /// What each dispatch is about, at multiples of `slot`.
    pub(crate) call: Shared,
    slot: u32,
    commands: vk::CommandBuffer,
    /// Owns the commands.
    _pool: Owned<vk::CommandPool>,
    fence: Owned<vk::Fence>,
    /// Two timestamps, where the queue has them.
    clock: Option<Owned<vk::QueryPool>>,
    queue: vk::Queue,
    timeout: u64,
    /// Why the device cannot be used any more.
    dead: Option<String>,
    core: Arc<Core>,
}

/// A kernel ready to run: a pipeline, and a descriptor set that names the buffers of the session.
pub(crate) struct Ready {
    pub(crate) pipeline: vk::Pipeline,
    pub(crate) layout: vk::PipelineLayout,
    pub(crate) set: vk::DescriptorSet,
}

/// What a chunk is.
pub(crate) struct Chunk {
    /// Points.
    pub(crate) count: u32,
    /// Points of a dispatch, a multiple of the workgroup.
    pub(crate) dispatch: u32,
    pub(crate) workgroup: u32,
    /// Bytes of the inputs, the uniform inputs and the outputs.
    pub(crate) bytes: [u64; 3],
}

/// Bytes of what a dispatch is about: count, strides, base.
pub(crate) const CALL_BYTES: u64 = 16;

impl Session {
    pub(crate) fn new(core: &Arc<Core>, family: u32, settings: &Settings) -> Result<Self, VulkanError> {
        let made = VulkanError::call("opening the device");
        let pool_info = vk::CommandPoolCreateInfo::default()
            .queue_family_index(family)
            .flags(vk::CommandPoolCreateFlags::RESET_COMMAND_BUFFER);
        // SAFETY: the family is the one that the device was made with, with one queue. What is made goes to an owner at
        // once, with the call that destroys its kind; the commands are their pool's.
        let (queue, pool, commands, fence) = unsafe {
            let queue = core.raw.get_device_queue(family, 0);
            let pool = core.raw.create_command_pool(&pool_info, None).map_err(&made)?;
            let pool = Owned::new(core, pool, |device, pool| device.destroy_command_pool(pool, None));
            let commands = vk::CommandBufferAllocateInfo::default().command_pool(pool.handle).command_buffer_count(1);
            let commands = core.raw.allocate_command_buffers(&commands).map_err(&made)?;
            let fence = core.raw.create_fence(&vk::FenceCreateInfo::default(), None).map_err(&made)?;
            (queue, pool, commands, Owned::new(core, fence, |device, fence| device.destroy_fence(fence, None)))
        };
        let commands = commands.into_iter().next().unwrap_or_default();
        let clock = if core.timestamp_bits == 0 {
            None
        } else {
            let info = vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(2);
            // SAFETY: the queue has timestamps; the owner destroys what is made.
            Some(unsafe {
                let clock = core.raw.create_query_pool(&info, None).map_err(&made)?;
                Owned::new(core, clock, |device, clock| device.destroy_query_pool(clock, None))
            })
        };
        let staged = settings.staged.unwrap_or(core.info.kind == DeviceKind::Discrete);
        let alignment = core.limits.min_uniform_buffer_offset_alignment.max(CALL_BYTES);
        let storage = vk::BufferUsageFlags::STORAGE_BUFFER;
        let mut session = Self {
            inputs: Shared::new(storage, Access::Write, staged),
            outputs: Shared::new(storage, Access::Read, staged),
            uniforms: Shared::new(storage, Access::Write, staged),
            call: Shared::new(vk::BufferUsageFlags::UNIFORM_BUFFER, Access::Write, false),
            slot: u32::try_from(alignment).unwrap_or(u32::MAX),
            commands,
            _pool: pool,
            fence,
            clock,
            queue,
            timeout: u64::try_from(settings.timeout.as_nanos()).unwrap_or(u64::MAX),
            dead: None,
            core: Arc::clone(core),
        };
        session.call.reserve(core, u64::from(session.slot) * u64::from(DISPATCHES))?;
        Ok(session)
    }

    /// Makes room for a chunk.
    pub(crate) fn reserve(&mut self, bytes: [u64; 3]) -> Result<(), VulkanError> {
        if let Some(why) = &self.dead {
            return Err(VulkanError::Failed(why.clone()));
        }
        let [inputs, uniforms, outputs] = bytes;
        self.inputs.reserve(&self.core, inputs)?;
        self.uniforms.reserve(&self.core, uniforms)?;
        self.outputs.reserve(&self.core, outputs)
    }

    /// Runs a kernel over the chunk that lies in the buffers, and waits for it. Returns how long the dispatches took, in
    /// nanoseconds of the device's clock, if it has one.
    pub(crate) fn run(&mut self, ready: &Ready, chunk: &Chunk) -> Result<Option<f64>, VulkanError> {
        let bases = || (0..chunk.count).step_by(chunk.dispatch.max(1) as usize);
        self.describe(chunk, bases())?;
        self.record(ready, chunk, bases()).map_err(VulkanError::call("writing commands"))?;
        self.submit()?;
        self.clock.as_ref().map(|clock| self.read(clock)).transpose()
    }

    /// Writes what each dispatch is about.
    fn describe(&mut self, chunk: &Chunk, bases: impl Iterator<Item = u32>) -> Result<(), VulkanError> {
        let slot = self.slot as usize;
        self.call.with(u64::from(self.slot) * u64::from(DISPATCHES), |bytes| {
            for (place, base) in bytes.chunks_exact_mut(slot).zip(bases) {
                let words = [chunk.count, chunk.count, chunk.count, base];
                let words = words.into_iter().flat_map(u32::to_le_bytes);
                place.iter_mut().zip(words).for_each(|(to, from)| *to = from);
            }
        })
    }

    fn record(&self, ready: &Ready, chunk: &Chunk, bases: impl Iterator<Item = u32>) -> Result<(), vk::Result> {
        let (device, commands) = (&self.core.raw, self.commands);
        let [inputs, uniforms, outputs] = chunk.bytes;
        let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the commands are not in use, for the submission before was waited for; all that they name lives until
        // they are done, and the buffers hold the bytes that are copied, as `reserve` saw to.
        unsafe {
            device.begin_command_buffer(commands, &begin)?;
            let copied = [(&self.inputs, inputs), (&self.uniforms, uniforms)]
                .into_iter()
                .filter_map(|(buffer, bytes)| buffer.stages().map(|(host, local)| self.copy(host, local, bytes)))
                .fold(false, |any, one| any | one);
            if copied {
                self.after(
                    (Stage::TRANSFER, AccessFlags::TRANSFER_WRITE),
                    (Stage::COMPUTE_SHADER, AccessFlags::SHADER_READ),
                );
            }
            device.cmd_bind_pipeline(commands, vk::PipelineBindPoint::COMPUTE, ready.pipeline);
            if let Some(clock) = &self.clock {
                device.cmd_reset_query_pool(commands, clock.handle, 0, 2);
                device.cmd_write_timestamp(commands, Stage::BOTTOM_OF_PIPE, clock.handle, 0);
            }
            for (index, base) in (0..).zip(bases) {
                let points = (chunk.count - base).min(chunk.dispatch);
                device.cmd_bind_descriptor_sets(
                    commands,
                    vk::PipelineBindPoint::COMPUTE,
                    ready.layout,
                    0,
                    &[ready.set],
                    &[self.slot * index],
                );
                device.cmd_dispatch(commands, points.div_ceil(chunk.workgroup.max(1)), 1, 1);
            }
            if let Some(clock) = &self.clock {
                device.cmd_write_timestamp(commands, Stage::BOTTOM_OF_PIPE, clock.handle, 1);
            }
            let computed = (Stage::COMPUTE_SHADER, AccessFlags::SHADER_WRITE);
            let read = (Stage::HOST, AccessFlags::HOST_READ);
            if let Some((host, local)) = self.outputs.stages() {
                self.after(computed, (Stage::TRANSFER, AccessFlags::TRANSFER_READ));
                self.copy(local, host, outputs);
                self.after((Stage::TRANSFER, AccessFlags::TRANSFER_WRITE), read);
            } else {
                self.after(computed, read);
            }
            device.end_command_buffer(commands)
        }
    }

    /// Copies the first bytes of a buffer; says whether there are any.
    ///
    /// # Safety
    /// The commands are being recorded, and both buffers have these bytes and are for such copies.
    unsafe fn copy(&self, from: vk::Buffer, to: vk::Buffer, bytes: u64) -> bool {
        if bytes > 0 {
            // SAFETY: as the caller promises.
            unsafe { self.core.raw.cmd_copy_buffer(self.commands, from, to, &[vk::BufferCopy::default().size(bytes)]) };
        }
        bytes > 0
    }

    /// What comes after sees what was written before.
    ///
    /// # Safety
    /// The commands are being recorded.
    unsafe fn after(&self, before: (Stage, AccessFlags), next: (Stage, AccessFlags)) {
        let barrier = [vk::MemoryBarrier::default().src_access_mask(before.1).dst_access_mask(next.1)];
        let none = vk::DependencyFlags::empty();
        // SAFETY: as the caller promises; the stages do what the accesses say.
        unsafe { self.core.raw.cmd_pipeline_barrier(self.commands, before.0, next.0, none, &barrier, &[], &[]) };
    }

    /// Has the device do the commands, and waits until it is at rest.
    fn submit(&mut self) -> Result<(), VulkanError> {
        let (device, fence, commands) = (&self.core.raw, [self.fence.handle], [self.commands]);
        let submits = [vk::SubmitInfo::default().command_buffers(&commands)];
        // SAFETY: the queue is used by one thread at a time, for `self` is borrowed alone; fence and commands are not in
        // use, and live until the fence is waited for. Where that fails, nothing that is in use is destroyed or used
        // again.
        let (submitted, waited) = unsafe {
            let submitted =
                device.reset_fences(&fence).and_then(|()| device.queue_submit(self.queue, &submits, self.fence.handle));
            (submitted, submitted.and_then(|()| device.wait_for_fences(&fence, true, self.timeout)))
        };
        match waited {
            Ok(()) => return Ok(()),
            Err(vk::Result::TIMEOUT) => {
                self.core.abandon();
                self.dead = Some(format!(
                    "{} took longer than {} s for a chunk of points and cannot be used any more: a loop may run without \
                     end there; open it again to evaluate something else",
                    self.core.info.name,
                    self.timeout as f64 / 1e9,
                ));
            }
            Err(vk::Result::ERROR_DEVICE_LOST) => {
                self.dead = Some(format!(
                    "{} was lost: its driver crashed, or stopped a kernel that ran too long; open it again, and \
                     evaluate fewer points at once",
                    self.core.info.name
                ));
            }
            // Nothing was submitted.
            Err(other) if submitted.is_err() => return Err(VulkanError::call("submitting commands")(other)),
            Err(other) => {
                self.core.abandon();
                self.dead = Some(format!("{} failed and cannot be used any more: {other}", self.core.info.name));
            }
        }
        Err(VulkanError::Failed(self.dead.clone().unwrap_or_default()))
    }

    /// The nanoseconds between the two timestamps.
    fn read(&self, clock: &Owned<vk::QueryPool>) -> Result<f64, VulkanError> {
        let mut ticks = [0_u64; 2];
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
        // SAFETY: both were written by commands that are done, as words of 64 bits.
        unsafe { self.core.raw.get_query_pool_results(clock.handle, 0, &mut ticks, flags) }
            .map_err(VulkanError::call("reading its clock"))?;
        let mask = u64::MAX.checked_shr(64 - self.core.timestamp_bits.min(64)).unwrap_or(0);
        let [start, end] = ticks;
        Ok((end.wrapping_sub(start) & mask) as f64 * f64::from(self.core.limits.timestamp_period))
    }

    /// The buffers as the kernel sees them: inputs, uniform inputs, outputs, calls.
    pub(crate) fn buffers(&self) -> [vk::Buffer; 4] {
        [self.inputs.kernel(), self.uniforms.kernel(), self.outputs.kernel(), self.call.kernel()]
    }
}
