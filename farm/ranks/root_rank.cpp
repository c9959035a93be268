// SPDX-License-Identifier: Apache-2.0
// Distributes the rendering of views from rank 0. Each camera is assigned to one rank that has its
// archive; if several have it, each gets a block of adjacent cameras. For a view, rank 0 sends a
// request to all ranks and sums their contributions along a tree (rank_views.h). Requests have one
// order on all ranks.
#include "farm/ranks/root_rank.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "base/error.h"

namespace raystage::farm {
namespace {

namespace fs = std::filesystem;

std::string list_text(const std::vector<std::string>& names) {
  constexpr std::size_t kMax = 8;
  if (names.size() <= kMax) return fmt::format("{}", fmt::join(names, ", "));
  return fmt::format("{} and {} more", fmt::join(names.begin(), names.begin() + kMax, ", "),
                     names.size() - kMax);
}

}  // namespace

/// Sums the contributions of all ranks to views of one light field of the shot.
class RootRank::LightField : public render::DistributedRenderer {
 public:
  LightField(RootRank& ranks, int number, std::vector<int> members)
      : ranks_(ranks), number_(number), members_(std::move(members)) {}

  render::Contribution sum(const render::DistributedViewRequest& view,
                           const ContributeFunction& own) const override {
    std::unique_lock is_lockstep(ranks_.in_step_, std::defer_lock);
    if (view.is_lockstep) is_lockstep.lock();
    Request request;
    request.kind = Request::Kind::kView;
    request.light_field = number_;
    request.view = view;
    request.view_number = ranks_.views_++;
    ranks_.send_to_all(request);
    render::FragmentCounts counts;
    ReduceTimes times;
    render::Contribution all = reduce_subtree(
        {ranks_.world_, fragment_encoding_for(view, ranks_.options_.encoding)}, request.view_number,
        number_, view.view,
        [&] {
          return contribute_as_rank({ranks_.world_, members_}, view, request.view_number, own);
        },
        counts, times);
    const std::scoped_lock lock(ranks_.mutex_);
    ranks_.traffic_.fragments += counts;
    ranks_.traffic_.times += times;
    ++ranks_.traffic_.views;
    ranks_.traffic_.view_pixels +=
        static_cast<std::int64_t>(render::view_value_count(view.view) / 4);
    return all;
  }

  bool omits_weights(const render::DistributedViewRequest& view) const override {
    return fragment_encoding_for(view, ranks_.options_.encoding).encoding ==
           render::FragmentEncoding::kJpeg;
  }

 private:
  RootRank& ranks_;
  int number_;
  std::vector<int> members_;
};

RootRank::RootRank(MpiWorld& world, RankOptions options)
    : world_(world), options_(std::move(options)), frames_(std::make_unique<FrameService>(world)) {}

RootRank::~RootRank() {
  if (!is_finished_) finish();
}

void RootRank::send_to_all(const Request& request) {
  const MessageBytes message = encode(request);
  // All ranks must get requests in one order: they wait for each other and work on few at a time.
  const std::scoped_lock lock(send_mutex_);
  for (int rank = 1; rank < world_.size(); ++rank) world_.send(rank, kRequestTag, message);
}

std::vector<int> RootRank::find_camera_owners(const store::Take& take,
                                              const std::vector<TakeTable>& tables) const {
  const auto cameras = static_cast<std::size_t>(take.camera_count());
  std::vector<int> owners;
  std::vector<std::string> missing;
  for (std::size_t camera = 0; camera < cameras; ++camera) {
    std::vector<int> candidates;
    for (std::size_t rank = 0; rank < tables.size(); ++rank) {
      if (camera < tables[rank].cameras.size() && tables[rank].cameras[camera].is_local) {
        candidates.push_back(static_cast<int>(rank));
      }
    }
    if (candidates.empty()) {
      missing.push_back(take.document().cameras[camera].id);
      owners.push_back(-1);
    } else {  // on shared storage each rank gets a block of adjacent cameras
      owners.push_back(candidates[camera * candidates.size() / cameras]);
    }
  }
  if (missing.empty()) return owners;
  const std::string what = fmt::format("no rank has the archives of {} of {} cameras: {}",
                                       missing.size(), cameras, list_text(missing));
  if (options_.missing == MissingArchives::kError || missing.size() == cameras) {
    throw Error::bad_input(what, take.folder().string(),
                           "Start ranks on the hosts that have them, or set missing archives to "
                           "\"absent\" to render without these cameras");
  }
  options_.on_message(what + "; they are absent from all frames");
  return owners;
}

store::Take RootRank::open(const fs::path& folder) {
  Request request;
  request.kind = Request::Kind::kOpen;
  request.take = static_cast<int>(takes_.size());
  request.folder = fs::absolute(folder).string();
  request.reply_tag = kFirstReplyTag - 1;
  send_to_all(request);
  const fs::path mine = local_take_folder(request.folder, options_.takes, 0);
  RankTake own = open_rank_take(world_, request.take, mine);
  std::vector<TakeTable> tables{own.table};
  for (int rank = 1; rank < world_.size(); ++rank) {
    tables.push_back(decode_take_table(world_.receive(rank, request.reply_tag)));
  }
  if (!own.take) {
    store::Take(mine, own.archives);  // throws the original error
    throw Error::bad_input(own.table.error, mine.string(), "Repair the take on this host");
  }
  for (std::size_t rank = 1; rank < tables.size(); ++rank) {
    if (!tables[rank].error.empty()) {
      if (options_.missing == MissingArchives::kError) {
        throw Error::bad_input(fmt::format("rank {} cannot open it: {}", rank, tables[rank].error),
                               request.folder,
                               "Copy take.json, rig.json and timeline.zst to that host "
                               "(`raystage join` can make only the documents), or set missing "
                               "archives to \"absent\" to render without its cameras");
      }
      options_.on_message(
          fmt::format("rank {} cannot open the take: {}", rank, tables[rank].error));
      tables[rank].cameras.clear();
    } else if (tables[rank].documents != own.table.documents) {
      throw Error::bad_input(
          fmt::format("take.json or rig.json of rank {} differ from those of rank 0", rank),
          request.folder, "Copy the same documents to all hosts");
    }
  }
  const std::vector<int> owners = find_camera_owners(*own.take, tables);
  std::vector<TakeTable::Camera> cameras(owners.size());
  for (std::size_t camera = 0; camera < owners.size(); ++camera) {
    if (owners[camera] < 0) continue;
    cameras[camera] = std::move(tables[owners[camera]].cameras[camera]);
  }
  OpenTake opened;
  opened.named = request.folder;
  opened.folder = mine;
  for (std::size_t rank = 0; rank < tables.size(); ++rank) {
    if (tables[rank].error.empty()) opened.ranks.push_back(static_cast<int>(rank));
  }
  own.archives->set_camera_owners(owners, std::move(cameras));
  opened.archives = own.archives;
  opened.served = std::move(own.take);
  frames_->add(request.take, *opened.served);
  takes_.push_back(std::move(opened));
  return store::Take(mine, takes_.back().archives);
}

void RootRank::check_rules() const {
  for (const PathMappingRule& rule : options_.takes) {
    const bool is_used = std::ranges::any_of(
        takes_, [&](const OpenTake& opened) { return path_rule_matches(rule, opened.named); });
    if (is_used) continue;
    throw Error::bad_input(fmt::format("no take of the shot is in the folder {}", rule.from),
                           "take folders of the ranks",
                           "Use the absolute path of a folder of the shot's takes as FROM");
  }
}

void RootRank::share(const store::Take& take, render::RendererOptions& settings) {
  const auto found = std::ranges::find(takes_, take.folder(), &OpenTake::folder);
  if (found == takes_.end()) {
    throw Error::failed("the take is not open on the ranks", take.folder().string(), "");
  }
  if (light_fields_ == 0) check_rules();
  Request request;
  request.kind = Request::Kind::kShare;
  request.take = static_cast<int>(found - takes_.begin());
  request.light_field = light_fields_++;
  request.cache_bytes = settings.cache_bytes;
  request.result_cache_bytes = settings.result_cache_bytes;
  request.working_bytes = settings.working_bytes;
  request.camera_owners = found->archives->camera_owners();
  request.ranks = found->ranks;
  send_to_all(request);
  settings.hosts = std::make_shared<const LightField>(*this, request.light_field, found->ranks);
  settings.rank_of_camera = host_indices(found->ranks, request.camera_owners);
  settings.this_rank = 0;
}

RankTraffic RootRank::finish() {
  is_finished_ = true;
  Request request;
  request.reply_tag = kFirstReplyTag - 1;
  send_to_all(request);
  frames_.reset();
  const std::scoped_lock lock(mutex_);
  for (const OpenTake& opened : takes_) {
    traffic_.frames.requests += opened.archives->fetched().requests;
    traffic_.frames.bytes += opened.archives->fetched().bytes;
  }
  traffic_.costs = measure_rank_costs(world_);
  for (int rank = 1; rank < world_.size(); ++rank) {
    const RankCosts costs = decode_rank_costs(world_.receive(rank, request.reply_tag));
    traffic_.costs.cpu_seconds += costs.cpu_seconds;
    traffic_.costs.waiting_cpu_seconds += costs.waiting_cpu_seconds;
    traffic_.costs.bytes_sent += costs.bytes_sent;
  }
  return traffic_;
}

}  // namespace raystage::farm
