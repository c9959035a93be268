// SPDX-License-Identifier: Apache-2.0
// Delivers the frames of a GigE Vision or USB3 Vision camera through Aravis, with the device's
// frame ids and without a copy where the driver's buffers suffice.
#include "ingest/sources/aravis_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <memory>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "base/error.h"
#include "ingest/sources/aravis_camera.h"
#include "ingest/sources/pixel_conversion.h"

namespace raystage::ingest {
namespace {

using Clock = std::chrono::steady_clock;

/// Host time at which a buffer was filled, in ns since 1970; 0 until then. One per buffer.
using Arrival = std::atomic<Nanoseconds>;

Arrival& arrival_of(ArvBuffer* buffer) {
  // The object is not constant, in spite of Aravis' signature.
  return *static_cast<Arrival*>(const_cast<void*>(arv_buffer_get_user_data(buffer)));
}

void note_arrival(void* /*unused*/, ArvStreamCallbackType type, ArvBuffer* buffer) {
  if (type == ARV_STREAM_CALLBACK_TYPE_BUFFER_DONE) arrival_of(buffer) = host_steady_now();
}

/// Returns the arrival time of a buffer. Aravis delivers a buffer before it calls note_arrival().
/// This waits for that call: the buffer must not be returned or freed earlier.
Nanoseconds noted_arrival(ArvBuffer* buffer) {
  using namespace std::chrono_literals;
  const auto deadline = Clock::now() + 20ms;
  for (;;) {
    if (const Nanoseconds noted = arrival_of(buffer); noted != 0) return noted;
    if (Clock::now() > deadline) return host_steady_now();
    std::this_thread::sleep_for(50us);
  }
}

class Stream {
 public:
  explicit Stream(ArvStream* stream) : stream_(stream) {}

  void add_buffer(std::size_t bytes) {
    ArvBuffer* buffer = arv_buffer_new_full(bytes, nullptr, new Arrival(0), [](void* arrival) {
      delete static_cast<Arrival*>(arrival);
    });
    // The missing parts of a torn frame must not show earlier contents of the memory.
    size_t ignored = 0;
    void* data = const_cast<void*>(arv_buffer_get_data(buffer, &ignored));
    if (data != nullptr) std::memset(data, 0, bytes);
    push(buffer);
  }
  void push(ArvBuffer* buffer) {
    arrival_of(buffer) = 0;
    arv_stream_push_buffer(stream_.get(), buffer);
  }
  ArvBuffer* pop(std::chrono::microseconds patience) {
    return arv_stream_timeout_pop_buffer(stream_.get(), static_cast<guint64>(patience.count()));
  }

  /// Lends a buffer until the result is released. The result does not own the stream: the stream
  /// keeps the camera open and must be able to close it earlier.
  static std::shared_ptr<const void> lend(const std::shared_ptr<Stream>& stream,
                                          ArvBuffer* buffer) {
    ++stream->lent_;
    return {buffer, [owner = std::weak_ptr<Stream>(stream)](ArvBuffer* returned) {
              if (const auto open_stream = owner.lock(); open_stream) {
                --open_stream->lent_;
                open_stream->push(returned);
              } else {
                g_object_unref(returned);
              }
            }};
  }
  int lent() const { return lent_; }

 private:
  GObjectPtr<ArvStream> stream_;
  std::atomic<int> lent_ = 0;
};

class AravisSource final : public FrameSource {
 public:
  explicit AravisSource(const schemas::RecordConfig::AravisSource& source)
      : buffers_(source.buffers), camera_(open_aravis_camera(source.device)) {
    configure_aravis_camera(camera_.get(), source);
    describe(source);
    open_stream(source);
    // The signal reports the loss of the camera from any thread.
    g_signal_connect(arv_camera_get_device(camera_.get()), "control-lost",
                     G_CALLBACK(&AravisSource::on_control_lost), this);
    GErrorHolder error;
    arv_camera_start_acquisition(camera_.get(), error.clear_and_get());
    if (error) {
      g_signal_handlers_disconnect_by_data(arv_camera_get_device(camera_.get()), this);
      throw fail("the camera does not start its acquisition: " + error.text());
    }
  }

  ~AravisSource() override {
    g_signal_handlers_disconnect_by_data(arv_camera_get_device(camera_.get()), this);
    GErrorHolder ignored;
    arv_camera_stop_acquisition(camera_.get(), ignored.clear_and_get());
  }

  const SourceDescription& description() const override { return description_; }

  Outcome next(SourceFrame& frame, std::chrono::milliseconds patience) override {
    using std::chrono::microseconds;
    constexpr microseconds kSlice(50'000);  // longest delay of an interruption
    const Clock::time_point deadline = Clock::now() + patience;
    for (;;) {
      if (interrupted_.exchange(false)) return Outcome::kNoData;
      const auto left = std::chrono::duration_cast<microseconds>(deadline - Clock::now());
      ArvBuffer* buffer = stream_->pop(std::clamp(left, microseconds(0), kSlice));
      if (buffer == nullptr) {
        if (control_lost_) return Outcome::kLost;
        if (Clock::now() >= deadline) return Outcome::kNoData;
      } else if (take(buffer, frame)) {
        return Outcome::kFrame;
      }
    }
  }

  std::string loss_reason() const override {
    return control_lost_ ? "the camera no longer responds" : "";
  }
  void interrupt() override { interrupted_ = true; }
  bool survives_failed_allocations() const override { return false; }  // GLib ends the process
  std::size_t memory_overhead() const override {
    constexpr std::size_t kDriver = 1 << 20;
    return static_cast<std::size_t>(buffers_) * payload_ + kDriver;
  }

 private:
  static void on_control_lost(ArvDevice* /*unused*/, AravisSource* self) {
    self->control_lost_ = true;
  }

  Error fail(std::string what) const {
    return Error::failed(std::move(what), description_.what,
                         "Check the connection, and close other programs that control the camera");
  }

  void describe(const schemas::RecordConfig::AravisSource& source) {
    GErrorHolder error;
    gint x = 0, y = 0;
    format_ = arv_camera_get_pixel_format(camera_.get(), error.clear_and_get());
    const char* format =
        arv_camera_get_pixel_format_as_string(camera_.get(), error.clear_and_get());
    const auto text = [](const char* value) { return std::string(value == nullptr ? "" : value); };
    const std::string model = text(arv_camera_get_model_name(camera_.get(), error.clear_and_get()));
    const std::string serial =
        text(arv_camera_get_device_serial_number(camera_.get(), error.clear_and_get()));
    description_.what = fmt::format("aravis {} {}, {}", model, serial, text(format));
    arv_camera_get_region(camera_.get(), &x, &y, &description_.width, &description_.height,
                          error.clear_and_get());
    if (error) throw fail("the camera does not report the size of its pictures: " + error.text());
    description_.fps = arv_camera_get_frame_rate(camera_.get(), error.clear_and_get());
    // The rate that a triggered camera states is not that of its trigger.
    if (error || is_triggered()) description_.fps = source.fps.value_or(0);
    description_.clock = "device";
    // The time stamps mark the start of the exposure or of the readout, depending on the maker.
    description_.timestamp_event = "unknown";
  }

  bool is_triggered() {
    GErrorHolder error;
    const char* mode = arv_camera_get_string(camera_.get(), "TriggerMode", error.clear_and_get());
    return !error && mode != nullptr && std::string_view(mode) == "On";
  }

  void open_stream(const schemas::RecordConfig::AravisSource& source) {
    GErrorHolder error;
    ArvStream* stream =
        arv_camera_create_stream(camera_.get(), note_arrival, nullptr, error.clear_and_get());
    if (stream == nullptr) throw fail("the camera does not open a stream: " + error.text());
    stream_ = std::make_shared<Stream>(stream);
    if (ARV_IS_GV_STREAM(stream)) {
      g_object_set(stream, "socket-buffer", ARV_GV_STREAM_SOCKET_BUFFER_FIXED, "socket-buffer-size",
                   source.socket_buffer_bytes, "packet-resend",
                   source.packet_resend ? ARV_GV_STREAM_PACKET_RESEND_ALWAYS
                                        : ARV_GV_STREAM_PACKET_RESEND_NEVER,
                   nullptr);
    }
    const guint bytes = arv_camera_get_payload(camera_.get(), error.clear_and_get());
    if (error) throw fail("the camera does not report the bytes per frame: " + error.text());
    payload_ = bytes;
    for (int i = 0; i < buffers_; ++i) stream_->add_buffer(payload_);
  }

  /// Fills `frame` from the buffer, or returns false if it is empty or late.
  bool take(ArvBuffer* buffer, SourceFrame& frame) {
    const ArvBufferStatus status = arv_buffer_get_status(buffer);
    const bool filled =
        status == ARV_BUFFER_STATUS_SUCCESS || status == ARV_BUFFER_STATUS_TIMEOUT ||
        status == ARV_BUFFER_STATUS_MISSING_PACKETS ||
        status == ARV_BUFFER_STATUS_WRONG_PACKET_ID || status == ARV_BUFFER_STATUS_SIZE_MISMATCH;
    frame.arrival_steady = noted_arrival(buffer);
    const std::uint64_t sequence = unwrap_frame_id(arv_buffer_get_frame_id(buffer));
    // Aravis may deliver an incomplete frame after later ones; the gap in `sequence` already shows
    // it. A counter that falls far back was reset.
    constexpr std::uint64_t kReset = 1000;
    const bool late =
        has_sequence_ && sequence <= last_sequence_ && last_sequence_ - sequence < kReset;
    if (!filled || late) {
      stream_->push(buffer);
      return false;
    }
    has_sequence_ = true;
    last_sequence_ = sequence;
    frame.sequence = sequence;
    frame.jpeg.clear();
    frame.torn = status != ARV_BUFFER_STATUS_SUCCESS;
    frame.device_time.reset();
    if (const guint64 stamp = arv_buffer_get_timestamp(buffer); stamp != 0) {
      frame.device_time = static_cast<Nanoseconds>(stamp);
    }
    deliver(buffer, frame);
    return true;
  }

  void deliver(ArvBuffer* buffer, SourceFrame& frame) {
    const std::shared_ptr<const void> owner = Stream::lend(stream_, buffer);
    frame.raw = {};
    size_t bytes = 0;
    const void* data = arv_buffer_get_data(buffer, &bytes);
    if (frame.torn) bytes = payload_;  // Aravis counts only the bytes that arrived
    AvPtr<AVFrame> picture(check_allocation(av_frame_alloc()));
    // A torn buffer does not describe its picture, so that the camera's settings apply. Where
    // packets are missing, it shows an earlier picture.
    picture->width = description_.width;
    picture->height = description_.height;
    picture->format = av_pixel_format(format_);
    gint padding = 0;
    if (!frame.torn) {
      gint x = 0, y = 0, rows_of_padding = 0;
      arv_buffer_get_image_region(buffer, &x, &y, &picture->width, &picture->height);
      arv_buffer_get_image_padding(buffer, &padding, &rows_of_padding);
      picture->format = av_pixel_format(arv_buffer_get_image_pixel_format(buffer));
    }
    picture->color_range = AVCOL_RANGE_JPEG;  // GenICam's YUV422_8 uses all codes
    const int row = padding + av_image_get_linesize(static_cast<AVPixelFormat>(picture->format),
                                                    picture->width, 0);
    if (data == nullptr || row <= padding ||
        bytes < static_cast<std::size_t>(row) * static_cast<std::size_t>(picture->height)) {
      frame.torn = true;
      return;
    }
    picture->data[0] = static_cast<std::uint8_t*>(const_cast<void*>(data));
    picture->linesize[0] = row;
    if (!converter_.convert(*picture, owner, frame.raw)) {
      frame.torn = true;
      return;
    }
    const bool in_drivers_buffer = frame.raw.owner == owner;
    if (in_drivers_buffer && stream_->lent() > buffers_ / 2) copy_out(frame.raw);
  }

  /// Copies an image in a driver's buffer, which has one plane, and returns the buffer.
  static void copy_out(store::RawImage& image) {
    const auto* from = image.planes[0].data;
    const std::size_t bytes = image.planes[0].stride * static_cast<std::size_t>(image.height);
    auto copy = std::make_shared<const std::vector<std::byte>>(from, from + bytes);
    image.planes[0].data = copy->data();
    image.owner = std::move(copy);
  }

  /// Returns the 64-bit id that is nearest to the last one. GigE Vision 1 counts frames from 1 to
  /// 65535 and starts again at 1; later versions and USB3 Vision have 64 bits.
  std::uint64_t unwrap_frame_id(std::uint64_t id) const {
    constexpr std::uint64_t kPeriod = 65535;
    if (!has_sequence_ || id > kPeriod) return id;
    std::uint64_t sequence = last_sequence_ / kPeriod * kPeriod + id;
    if (sequence + kPeriod / 2 < last_sequence_) sequence += kPeriod;
    if (sequence > last_sequence_ + kPeriod / 2 && sequence >= kPeriod) sequence -= kPeriod;
    return sequence;
  }

  int buffers_;
  GObjectPtr<ArvCamera> camera_;
  std::shared_ptr<Stream> stream_;
  SourceDescription description_;
  ArvPixelFormat format_ = 0;
  std::size_t payload_ = 0;  ///< bytes of a buffer
  PixelConverter converter_;
  std::atomic<bool> interrupted_ = false, control_lost_ = false;
  bool has_sequence_ = false;
  std::uint64_t last_sequence_ = 0;
};

}  // namespace

std::unique_ptr<FrameSource> open_aravis_source(const schemas::RecordConfig::AravisSource& source) {
  return std::make_unique<AravisSource>(source);
}

}  // namespace raystage::ingest
