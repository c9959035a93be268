// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "farm/ranks/mpi_world.h"
#include "render/common/fragment_encoding.h"
#include "render/renderer.h"
#include "store/archive.h"
#include "store/jpeg/layout.h"

// The messages between the ranks that render a shot together: CBOR (RFC 8949) with exact doubles,
// followed by large arrays as raw bytes. All ranks run the same program. Decoders throw Error
// (failed) for a damaged message.

namespace raystage::farm {

/// MPI tags.
enum MessageTag : int {
  kRequestTag = 1,       ///< from rank 0: a Request
  kFrameRequestTag = 2,  ///< between any two: a FrameRequest
  kFirstReplyTag = 1024  ///< tags from here on belong to one request each
};

/// A request of rank 0 to all other ranks.
struct Request {
  enum class Kind : std::uint8_t {
    kOpen,   ///< open a take; the reply is a TakeTable
    kShare,  ///< prepare to contribute to views of a take
    kView,   ///< contribute to a view; the reply goes along the tree
    kStop    ///< the last request; the reply is a RankCosts
  };
  Kind kind = Kind::kStop;
  int reply_tag = 0;
  int take = 0;         ///< number of the take, in the order of kOpen requests
  int light_field = 0;  ///< number of the light field, in the order of kShare requests
  std::string folder;   ///< kOpen: the take's folder, as rank 0 names it
  /// kShare: as in RendererOptions.
  std::uint64_t cache_bytes = 0, result_cache_bytes = 0, working_bytes = 0;
  std::vector<int> camera_owners;       ///< kShare: rank of each camera's archive; -1: none
  std::vector<int> ranks;               ///< kShare: ranks that have opened the take, increasing
  render::DistributedViewRequest view;  ///< kView
  std::uint32_t view_number = 0;        ///< kView
};
MessageBytes encode(const Request& request);
Request decode_request(std::span<const std::byte> message);

/// The parts of a take that a rank has, or the reason why it cannot open the take.
struct TakeTable {
  struct Camera {
    bool is_local = false;
    store::ArchiveWriter::Description description;
    std::vector<store::FrameRecord> frames;
    /// ArchiveReader::recorded_xxh3() of each frame of an archive of video; empty: of others.
    std::vector<std::uint64_t> recorded_xxh3;
  };
  std::string documents;  ///< hash of take.json and rig.json; must be equal on all ranks
  std::vector<Camera> cameras;
  std::string error;  ///< not empty: the take cannot be opened
};
MessageBytes encode(const TakeTable& table);
TakeTable decode_take_table(std::span<const std::byte> message);

/// The costs of a rank since its start.
struct RankCosts {
  double cpu_seconds = 0;          ///< of its process
  double waiting_cpu_seconds = 0;  ///< part of cpu_seconds, see MessageCosts
  std::int64_t bytes_sent = 0;
};
MessageBytes encode(const RankCosts& costs);
RankCosts decode_rank_costs(std::span<const std::byte> message);
RankCosts measure_rank_costs(const MpiWorld& world);

/// The wall-clock times of a rank for its part of a view, in milliseconds.
struct RankTimes {
  double local_ms = 0;   ///< decoding and sampling its own cameras
  double add_ms = 0;     ///< adding the contributions of the ranks below it
  double encode_ms = 0;  ///< encoding fragments
  double sum_ms() const { return local_ms + add_ms + encode_ms; }
};

/// The sum of the contributions of a rank and the ranks below it in the tree, or their error.
struct PartialView {
  std::string error;  ///< not empty: the cause of the failure; the rest is empty
  bool is_bad_input = false;
  render::RenderStatistics statistics;
  std::vector<std::string> notes;
  render::FragmentCounts counts;     ///< of this message and all messages below
  RankTimes slowest;                 ///< of this rank and all ranks below
  std::vector<MessageBytes> planes;  ///< encode_fragments() of each plane
};
MessageBytes encode(const PartialView& view);
PartialView decode_partial_view(std::span<const std::byte> message);

/// A request for a frame, to the rank that has the camera's archive.
struct FrameRequest {
  enum class Kind : std::uint8_t { kWhole, kLayout, kSegments };
  Kind kind = Kind::kWhole;
  int reply_tag = 0;
  int take = 0, camera = 0, frame = 0;
  std::vector<std::uint32_t> segments;  ///< kSegments: indices in the scan, increasing
};
MessageBytes encode(const FrameRequest& request);
FrameRequest decode_frame_request(std::span<const std::byte> message);

/// The reply to a FrameRequest. kWhole: all bytes of the JPEG file. kLayout: its layout. kSegments:
/// the bytes before the scan, followed by the segments.
struct FrameReply {
  std::string error;                        ///< not empty: the frame cannot be read
  std::optional<store::JpegLayout> layout;  ///< kLayout: one that decoders can rely on
  MessageBytes bytes;
};
MessageBytes encode(const FrameReply& reply);
FrameReply decode_frame_reply(std::span<const std::byte> message);

}  // namespace raystage::farm
