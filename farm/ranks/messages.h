// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <vector>

#include "farm/ranks/mpi_world.h"
#include "render/common/fragment_encoding.h"
#include "render/renderer.h"
#include "store/archive.h"
#include "store/jpeg/decode.h"
#include "store/jpeg/layout.h"

// The messages between the ranks that render a shot together: CBOR (RFC 8949), doubles exact; large
// arrays follow it as they are. All ranks run the same program.

namespace raystage::farm {

/// MPI tags.
enum MessageTag : int {
  kRequestTag = 1,       ///< from rank 0: a Request
  kFrameRequestTag = 2,  ///< between any two: a FrameRequest
  kFirstReplyTag = 1024  ///< tags from here on belong to one request each
};

/// What rank 0 asks all others for.
struct Request {
  enum class Kind : std::uint8_t {
    kOpen,   ///< a take: replies with a TakeTable
    kShare,  ///< be ready to contribute to views of a take
    kView,   ///< contribute to a view: replies along the tree
    kStop    ///< nothing follows; replies with its RankCosts
  };
  Kind kind = Kind::kStop;
  int reply_tag = 0;
  int take = 0;         ///< number of the take, by order of kOpen
  int light_field = 0;  ///< number of the light field, by order of kShare
  std::string folder;   ///< kOpen: of the take, as rank 0 names it
  std::uint64_t cache_bytes = 0, result_cache_bytes = 0,
                working_bytes = 0;  ///< kShare: RendererSettings
  std::vector<int> camera_owners;   ///< kShare: rank; -1: none
  std::vector<int> ranks;           ///< kShare: that have opened the take, increasing
  DistributedViewRequest view;      ///< kView
  std::uint32_t view_number = 0;    ///< kView
};
MessageBytes encode(const Request& request);
Request decode_request(std::span<const std::byte> message);

/// What a rank has of a take, or why it has nothing.
struct TakeTable {
  struct Camera {
    bool is_local = false;
    ArchiveWriter::Description description;
    std::vector<FrameRecord> frames;
  };
  std::string documents;  ///< hash of take.json and rig.json, which must be alike
  std::vector<Camera> cameras;
  std::string error;  ///< not empty: the take cannot be opened
};
MessageBytes encode(const TakeTable& table);
TakeTable decode_take_table(std::span<const std::byte> message);

/// What a rank took from its start on.
struct RankCosts {
  double cpu_seconds = 0;          ///< of its process
  double waiting_cpu_seconds = 0;  ///< of these: polls that found nothing, see MessageCosts
  std::int64_t bytes_sent = 0;
};
MessageBytes encode(const RankCosts& costs);
RankCosts decode_rank_costs(std::span<const std::byte> message);
RankCosts measure_rank_costs(const MpiWorld& world);

/// What a rank took for its part of a view, wall-clock milliseconds.
struct RankTimes {
  double local_ms = 0;   ///< decoding and sampling its own cameras
  double add_ms = 0;     ///< adding the contributions of those below it
  double encode_ms = 0;  ///< encoding fragments
  double sum_ms() const { return local_ms + add_ms + encode_ms; }
};

/// What became of a rank's contribution, with those below it in the tree.
struct PartialView {
  std::string error;  ///< not empty: what happened; the rest is empty
  bool is_bad_input = false;
  RenderStatistics statistics;
  std::vector<std::string> notes;
  FragmentCounts counts;             ///< of all messages below, this one included
  RankTimes slowest;                 ///< of all ranks below, this one included
  std::vector<MessageBytes> planes;  ///< encode_fragments() of each plane
};
MessageBytes encode(const PartialView& view);
PartialView decode_partial_view(std::span<const std::byte> message);

/// Asks the holder of a camera for a frame.
struct FrameRequest {
  enum class Kind : std::uint8_t { kWhole, kLayout, kSegments };
  Kind kind = Kind::kWhole;
  int reply_tag = 0;
  int take = 0, camera = 0, frame = 0;
  std::vector<std::uint32_t> segments;  ///< kSegments: of the scan, in order
};
MessageBytes encode(const FrameRequest& request);
FrameRequest decode_frame_request(std::span<const std::byte> message);

/// kWhole: all bytes. kLayout: the structure. kSegments: the bytes before the scan, then the
/// segments, one after the other.
struct FrameReply {
  std::string error;  ///< not empty: the frame cannot be read
  JpegLayout layout;
  MessageBytes bytes;
};
MessageBytes encode(const FrameReply& reply);
FrameReply decode_frame_reply(std::span<const std::byte> message);

}  // namespace raystage::farm
