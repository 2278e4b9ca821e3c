//! Buffers that grow and never shrink, so that an ordinary frame allocates nothing.

/// A buffer with spare capacity.
#[derive(Debug)]
pub(crate) struct GrowingBuffer {
    buffer: wgpu::Buffer,
    usage: wgpu::BufferUsages,
    label: &'static str,
}

impl GrowingBuffer {
    pub(crate) fn new(device: &wgpu::Device, label: &'static str, usage: wgpu::BufferUsages) -> Self {
        let usage = usage | wgpu::BufferUsages::COPY_DST;
        Self { buffer: create(device, label, usage, 1024), usage, label }
    }

    /// Grows to this many bytes; new bytes are zero.
    pub(crate) fn reserve(&mut self, device: &wgpu::Device, bytes: u64) {
        if self.buffer.size() < bytes {
            let size = (bytes + bytes / 4).next_multiple_of(1024);
            self.buffer = create(device, self.label, self.usage, size);
        }
    }

    /// Replaces the content, from the start.
    pub(crate) fn write(&mut self, device: &wgpu::Device, queue: &wgpu::Queue, bytes: &[u8]) {
        self.reserve(device, bytes.len() as u64);
        if !bytes.is_empty() {
            queue.write_buffer(&self.buffer, 0, bytes);
        }
    }

    pub(crate) fn slice(&self) -> wgpu::BufferSlice<'_> {
        self.buffer.slice(..)
    }
}

fn create(device: &wgpu::Device, label: &'static str, usage: wgpu::BufferUsages, size: u64) -> wgpu::Buffer {
    device.create_buffer(&wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false })
}
