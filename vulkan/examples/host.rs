//! Runs a compute kernel of `isograd compile --target spirv` with nothing but Vulkan: the module, and the JSON file beside
//! it that says where everything goes. None of Isograd's own code is needed.
//!
//! ```text
//! isograd compile ball.vola --export ball --query value --query 'gradient(at)' --target spirv -o ball.spv
//! cargo run --release -p isograd-vulkan --example host -- ball.spv ball.spv.json
//! ```

#![allow(unsafe_code, reason = "Vulkan is an interface of C")]

use std::error::Error;
use std::{env, fs, slice};

use ash::{Device, Entry, Instance, vk};
use serde_json::Value;

fn main() -> Result<(), Box<dyn Error>> {
    let paths: Vec<String> = env::args().skip(1).collect();
    let [module, manifest] = paths.as_slice() else { return Err("usage: host MODULE.spv MANIFEST.json".into()) };
    let code = ash::util::read_spv(&mut fs::File::open(module)?)?;
    let manifest: Value = serde_json::from_str(&fs::read_to_string(manifest)?)?;
    if manifest["precision"] != "f32" {
        return Err("this program is for kernels in f32".into());
    }

    // What the kernel is to compute: three points, and the parameters that all of them share at their defaults. Each port
    // has columns, one per scalar; a column of a varying port lies at `offset * stride` and has an element for each
    // point, one of a uniform port is a single element at `offset`.
    let points: [[f32; 3]; 3] = [[3.0, 0.0, 4.0], [0.0, 0.5, 0.0], [-1.0, 2.0, -2.0]];
    let count = points.len();
    let (mut inputs, mut uniforms) = (Vec::new(), Vec::new());
    for port in list(&manifest["inputs"]) {
        for (axis, column) in list(&port["columns"]).iter().enumerate() {
            let offset = number(&column["offset"])?;
            if port["rate"] == "varying" {
                inputs.resize(inputs.len().max((offset + 1) * count), 0_f32);
                for (i, point) in points.iter().enumerate() {
                    inputs[offset * count + i] = *point.get(axis).ok_or("points have three coordinates")?;
                }
            } else {
                uniforms.resize(uniforms.len().max(offset + 1), 0_f32);
                uniforms[offset] = column["default"].as_f64().ok_or("a parameter has no default")? as f32;
            }
        }
    }
    let outputs: Vec<&Value> = list(&manifest["outputs"]).iter().flat_map(|port| list(&port["columns"])).collect();
    // What the call is about: the number of points, the strides of inputs and outputs, and where to begin.
    let call = [count as u32, count as u32, count as u32, 0];

    // SAFETY: every handle is made here, used as Vulkan asks for, and destroyed after the device is at rest.
    let results = unsafe {
        let entry = Entry::load()?;
        let application = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_1);
        let instance =
            entry.create_instance(&vk::InstanceCreateInfo::default().application_info(&application), None)?;

        // The first device that computes, and a queue of it.
        let computes = |device: &vk::PhysicalDevice| {
            let families = instance.get_physical_device_queue_family_properties(*device);
            families.iter().position(|f| f.queue_flags.contains(vk::QueueFlags::COMPUTE))
        };
        let all = instance.enumerate_physical_devices()?;
        let (physical, family) =
            all.into_iter().find_map(|device| Some((device, computes(&device)? as u32))).ok_or("no device computes")?;
        let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(family).queue_priorities(&[1.0])];
        let device =
            instance.create_device(physical, &vk::DeviceCreateInfo::default().queue_create_infos(&queues), None)?;
        let queue = device.get_device_queue(family, 0);

        // One buffer per binding of the manifest, filled by the host. A binding that is not there has nothing in it.
        let storage = vk::BufferUsageFlags::STORAGE_BUFFER;
        let mut bound = Vec::new();
        for (name, usage, words) in [
            ("inputs", storage, bits(&inputs)),
            ("outputs", storage, vec![0; outputs.len() * count]),
            ("call", vk::BufferUsageFlags::UNIFORM_BUFFER, call.to_vec()),
            ("uniforms", storage, bits(&uniforms)),
        ] {
            if let Some(binding) = manifest["bindings"][name].as_u64() {
                let (buffer, memory) = buffer(&instance, physical, &device, usage, &words)?;
                bound.push((name, binding as u32, usage, buffer, memory));
            }
        }

        // The pipeline: the bindings, the module, its entry point.
        let kind = |usage| {
            if usage == storage { vk::DescriptorType::STORAGE_BUFFER } else { vk::DescriptorType::UNIFORM_BUFFER }
        };
        let bindings: Vec<_> = bound
            .iter()
            .map(|(_, binding, usage, ..)| {
                vk::DescriptorSetLayoutBinding::default()
                    .binding(*binding)
                    .descriptor_type(kind(*usage))
                    .descriptor_count(1)
                    .stage_flags(vk::ShaderStageFlags::COMPUTE)
            })
            .collect();
        let set_layouts = [device
            .create_descriptor_set_layout(&vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings), None)?];
        let layout =
            device.create_pipeline_layout(&vk::PipelineLayoutCreateInfo::default().set_layouts(&set_layouts), None)?;
        let shader = device.create_shader_module(&vk::ShaderModuleCreateInfo::default().code(&code), None)?;
        let name = std::ffi::CString::new(manifest["entry"].as_str().ok_or("no entry point")?)?;
        let stage = vk::PipelineShaderStageCreateInfo::default()
            .stage(vk::ShaderStageFlags::COMPUTE)
            .module(shader)
            .name(&name);
        let create = [vk::ComputePipelineCreateInfo::default().stage(stage).layout(layout)];
        let pipeline = device.create_compute_pipelines(vk::PipelineCache::null(), &create, None).map_err(|e| e.1)?[0];

        // The descriptor set: which buffer is at which binding.
        let sizes = [(vk::DescriptorType::STORAGE_BUFFER, 3), (vk::DescriptorType::UNIFORM_BUFFER, 1)]
            .map(|(ty, descriptor_count)| vk::DescriptorPoolSize { ty, descriptor_count });
        let sets = device
            .create_descriptor_pool(&vk::DescriptorPoolCreateInfo::default().max_sets(1).pool_sizes(&sizes), None)?;
        let allocate = vk::DescriptorSetAllocateInfo::default().descriptor_pool(sets).set_layouts(&set_layouts);
        let set = device.allocate_descriptor_sets(&allocate)?[0];
        for (_, binding, usage, buffer, _) in &bound {
            let info = [vk::DescriptorBufferInfo { buffer: *buffer, offset: 0, range: vk::WHOLE_SIZE }];
            let write = vk::WriteDescriptorSet::default().dst_set(set).dst_binding(*binding);
            device.update_descriptor_sets(&[write.descriptor_type(kind(*usage)).buffer_info(&info)], &[]);
        }

        // The commands: one workgroup for every `workgroup` points. A device need not take more than 65,535 workgroups at
        // once; more points are several dispatches, each with its `base`.
        let groups = count.div_ceil(number(&manifest["workgroup"])?) as u32;
        let pool =
            device.create_command_pool(&vk::CommandPoolCreateInfo::default().queue_family_index(family), None)?;
        let allocate = vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(1);
        let commands = device.allocate_command_buffers(&allocate)?[0];
        device.begin_command_buffer(commands, &vk::CommandBufferBeginInfo::default())?;
        device.cmd_bind_pipeline(commands, vk::PipelineBindPoint::COMPUTE, pipeline);
        device.cmd_bind_descriptor_sets(commands, vk::PipelineBindPoint::COMPUTE, layout, 0, &[set], &[]);
        device.cmd_dispatch(commands, groups, 1, 1);
        let written = vk::MemoryBarrier::default()
            .src_access_mask(vk::AccessFlags::SHADER_WRITE)
            .dst_access_mask(vk::AccessFlags::HOST_READ);
        let (from, to) = (vk::PipelineStageFlags::COMPUTE_SHADER, vk::PipelineStageFlags::HOST);
        device.cmd_pipeline_barrier(commands, from, to, vk::DependencyFlags::empty(), &[written], &[], &[]);
        device.end_command_buffer(commands)?;
        let submit = [commands];
        let submit = [vk::SubmitInfo::default().command_buffers(&submit)];
        device.queue_submit(queue, &submit, vk::Fence::null())?;
        device.queue_wait_idle(queue)?;

        // The results, column after column.
        let (.., memory) = bound.iter().find(|(name, ..)| *name == "outputs").ok_or("no outputs")?;
        let start = device.map_memory(*memory, 0, vk::WHOLE_SIZE, vk::MemoryMapFlags::empty())?;
        let results = slice::from_raw_parts(start.cast::<f32>(), outputs.len() * count).to_vec();

        device.destroy_command_pool(pool, None);
        device.destroy_descriptor_pool(sets, None);
        device.destroy_pipeline(pipeline, None);
        device.destroy_shader_module(shader, None);
        device.destroy_pipeline_layout(layout, None);
        device.destroy_descriptor_set_layout(set_layouts[0], None);
        for (.., buffer, memory) in bound {
            device.destroy_buffer(buffer, None);
            device.free_memory(memory, None);
        }
        device.destroy_device(None);
        instance.destroy_instance(None);
        results
    };

    for (i, point) in points.iter().enumerate() {
        print!("at {point:?}:");
        for column in &outputs {
            let result = results[number(&column["offset"])? * count + i];
            print!(" {} = {result}", column["name"].as_str().unwrap_or_default());
        }
        println!();
    }
    Ok(())
}

/// A buffer with these words, in memory that the host and the device see.
unsafe fn buffer(
    instance: &Instance,
    physical: vk::PhysicalDevice,
    device: &Device,
    usage: vk::BufferUsageFlags,
    words: &[u32],
) -> Result<(vk::Buffer, vk::DeviceMemory), Box<dyn Error>> {
    let size = size_of_val(words) as u64;
    // SAFETY: the handles are alive, and the memory is as large as the buffer needs and visible to the host.
    unsafe {
        let buffer = device.create_buffer(&vk::BufferCreateInfo::default().size(size).usage(usage), None)?;
        let needs = device.get_buffer_memory_requirements(buffer);
        let host = vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT;
        let types = instance.get_physical_device_memory_properties(physical).memory_types;
        let fits =
            |(i, t): &(u32, vk::MemoryType)| needs.memory_type_bits >> i & 1 == 1 && t.property_flags.contains(host);
        let (index, _) = (0..).zip(types).find(fits).ok_or("no memory is visible to the host")?;
        let allocate = vk::MemoryAllocateInfo::default().allocation_size(needs.size).memory_type_index(index);
        let memory = device.allocate_memory(&allocate, None)?;
        device.bind_buffer_memory(buffer, memory, 0)?;
        let start = device.map_memory(memory, 0, vk::WHOLE_SIZE, vk::MemoryMapFlags::empty())?;
        slice::from_raw_parts_mut(start.cast::<u32>(), words.len()).copy_from_slice(words);
        device.unmap_memory(memory);
        Ok((buffer, memory))
    }
}

fn bits(numbers: &[f32]) -> Vec<u32> {
    numbers.iter().map(|x| x.to_bits()).collect()
}

fn list(value: &Value) -> &[Value] {
    value.as_array().map_or(&[], Vec::as_slice)
}

fn number(value: &Value) -> Result<usize, Box<dyn Error>> {
    Ok(value.as_u64().ok_or("the manifest lacks a number")?.try_into()?)
}
