#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "core/worker_thread.h"
#include "remote/api/auth_sessions.h"
#include "remote/api/messages.h"
#include "remote/api/state.h"
#include "remote/api/thumbnails.h"
#include "remote/api/ws_client.h"
#include "remote/http/http.h"
#include "remote/http/http_handler.h"
#include "remote/http/static_files.h"
#include "remote/tablet/image_providers.h"
#include "scene/comments.h"

namespace limn::remote {

/// Edits that wait for the session at once; with one more they are refused.
constexpr std::size_t k_most_wishes = 256;
/// How long the session may take over an edit before HTTP answers that it did not come.
constexpr std::chrono::seconds k_longest_wish{10};
/// Between two room images, and how long a frame of the window may take before the next one is looked at.
constexpr std::chrono::milliseconds k_between_rooms{66}, k_longest_look{10000};

/// A room image that took so long to draw is followed by another after so many times as long: projectors go
/// first, also where one processor draws for all.
constexpr int k_room_rest = 8;
/// Who does not have the last one is given it during that rest, unless it came longer ago: then another is
/// drawn at once.
constexpr std::chrono::seconds k_room_lasts{3};
/// Tablets whose windows are open at once.
constexpr std::ptrdiff_t k_most_windows = 8;
/// Of a project's comments, how many the state has: the newest.
constexpr std::size_t k_told_comments = 100;

/// An edit that a guest wants, and what became of it.
struct Wish {
  std::uint64_t number = 0;
  scene::Edit edit;
  std::string who;
  std::chrono::steady_clock::time_point since;  ///< too late after k_longest_wish: it was refused by then
};
struct Outcome {
  std::uint64_t number = 0;
  std::string why;  ///< it was not done; empty: it was
};

/// News of the session.
struct SessionNews {
  SessionState state;
  std::vector<cv::Mat> projectors;  ///< what they show, 8-bit BGR; nobody writes into them any more
  std::vector<scene::Look> looks;
  std::shared_ptr<const scene::Scene> scene;
  std::vector<Outcome> outcomes;  ///< of wishes; the state has them
};

/// Where guests arrive: who may come in, what they may have, who is told what (docs/remote.md). Belongs to
/// the thread of the network and knows nothing of it: requests go in, answers come out.
class Reception : public HttpHandler {
 public:
  using Clock = std::chrono::steady_clock;
  struct Setup {
    bool is_encrypted = false;
    bool is_loopback = true;  ///< only this machine's own names are answered
    std::string authority;    ///< certificate (DER) that devices may trust; empty: there is none
    std::string cookie;       ///< its name: another for every port, since browsers keep one for all of a host
    StaticFiles files;
    ImageProviders providers;
    WorkerThread* worker = nullptr;
    std::function<void(Wish)> wish;  ///< to the session
    /// To the session: where a guest's tablet looks from, by each image; nullopt: its window is closed.
    std::function<void(const std::string& guest, const std::optional<Eigen::Vector3d>& p_viewpoint_world)>
        place;
    std::function<void(bool)> watched;                ///< whether anybody is paired
    std::function<void(std::function<void()>)> post;  ///< runs it on this object's thread; from any thread
  };
  explicit Reception(Setup setup);

  const AuthSessions& guests() const { return guests_; }

  void handle_request(const HttpRequest& request, ResponseCallback answering) override;
  std::variant<std::shared_ptr<WebSocketPeer>, HttpResponse> accept_web_socket(
      const HttpRequest& request) override;
  /// For a request of /api/live: who comes in, or why not.
  std::variant<std::shared_ptr<WsClient>, HttpResponse> admit(const HttpRequest& request);
  /// Once the visitor's `wake` is there.
  void greet(const std::shared_ptr<WsClient>& client);
  void hear_text(const std::shared_ptr<WsClient>& client, std::string_view text);
  void hear_bytes(const std::shared_ptr<WsClient>& client, std::span<const std::uint8_t> bytes);
  void gone(const std::shared_ptr<WsClient>& client);

  /// Guests of lesser roles see no image of the room until then.
  void hide_room(Role role, Clock::time_point until);

  void take(SessionNews news);
  /// Some ten times a second: what time brings.
  void update_at(Clock::time_point now) override;
  /// Says goodbye to all.
  void close_clients(const std::string& why) override;
  /// When that thread is no more: lets go of the eyes, which answer for the last time.
  void blind() { setup_.providers = {}; }

  std::size_t client_count() const override { return visitors_.size(); }

 private:
  struct Asked {
    AuthSessions::Guest guest;
    std::string path;
    std::string body;
    std::string etag;
  };
  struct Route;
  class Connection;
  static const std::vector<Route>& routes();
  std::optional<HttpResponse> refuse(const HttpRequest& request) const;
  std::optional<AuthSessions::Guest> guest_of(const HttpRequest& request) const;
  HttpResponse file(const HttpRequest& request, const std::string& path) const;
  HttpResponse pair(const HttpRequest& request);

  void get_state(const Asked& asked, ResponseCallback answering);
  void get_actions(const Asked& asked, ResponseCallback answering);
  void get_room(const Asked& asked, ResponseCallback answering);
  void get_projector(const Asked& asked, ResponseCallback answering);
  void get_look_image(const Asked& asked, ResponseCallback answering);
  void get_look_assembly(const Asked& asked, ResponseCallback answering);
  void get_variant_image(const Asked& asked, ResponseCallback answering);
  void do_on_worker(std::function<HttpResponse()> job, ResponseCallback answering);
  void post_comment(const Asked& asked, ResponseCallback answering);
  void post_edit(const Asked& asked, ResponseCallback answering);
  void post_leave(const Asked& asked, ResponseCallback answering);

  using Done = std::function<void(const std::string& why, std::uint64_t number)>;
  /// `done` is called when the state has it; why it cannot be tried at all.
  std::optional<HttpResponse> wish(const AuthSessions::Guest& guest, const scene::Edit& edit, Done done);
  /// The same for a comment: `done` is called when it is saved.
  std::optional<HttpResponse> remark(const AuthSessions::Guest& guest,
                                     const CommentRequest& remark,
                                     Done done);
  void load_comments();
  Done answer_to(const std::shared_ptr<WsClient>& client, std::uint64_t id);
  void refuse(const std::shared_ptr<WsClient>& client, std::uint64_t id, const HttpResponse& refused);
  void hear(const std::shared_ptr<WsClient>& client, const EditMessage& message);
  void hear(const std::shared_ptr<WsClient>& client, const CommentMessage& message);
  void hear(const std::shared_ptr<WsClient>& client, const ImagesMessage& message);
  void hear(const std::shared_ptr<WsClient>& client, const ImageShownMessage& message);
  void hear(const std::shared_ptr<WsClient>& client, const WindowMessage& message);
  void refuse(const std::shared_ptr<WsClient>& client,
              std::optional<std::uint64_t> id,
              const std::string& why);
  void look(const std::shared_ptr<WsClient>& client, WsClient::Frame frame);
  void close_window(const std::shared_ptr<WsClient>& client);
  bool is_eye(const std::shared_ptr<WsClient>& client, Clock::time_point now) const;
  void looked(const std::shared_ptr<WsClient>& client, std::uint32_t number, const CompositeImage& seen);
  void ask_for_room(Clock::time_point now);
  void room_came(CompositeImage seen);
  void show_room(const std::shared_ptr<WsClient>& client);
  bool may_see_room(const AuthSessions::Guest& guest) const;
  void publish();

  struct Waiting {
    Done done;
    Clock::time_point since;
  };
  struct Encoded {
    cv::Mat image;
    std::shared_ptr<const std::string> jpeg;
  };

  Setup setup_;
  AuthSessions guests_;
  std::vector<std::shared_ptr<WsClient>> visitors_;
  std::optional<SessionNews> news_;
  std::string told_;  // the state, but for its number
  std::shared_ptr<const std::string> state_;
  std::uint64_t number_ = 0, edit_number_ = 0;
  std::size_t edit_count_ = 0;
  std::map<std::uint64_t, Waiting> wishes_;
  std::uint64_t last_wish_ = 0;
  std::optional<Result<std::vector<scene::Comment>>> comments_;  // none before the first news
  bool room_is_asked_ = false;
  Clock::time_point room_asked_at_, room_came_at_, room_next_at_;
  CompositeImage room_;
  Role room_role_ = Role::look;  // the least that may see it, also when nothing is hidden any more
  std::shared_ptr<const std::string> room_message_;
  std::uint32_t room_number_ = 0;
  // Which of a guest's windows is its tablet: the one that was opened last, until it has given no place for
  // as long as one lasts; then the next that gives one.
  struct GuestEye {
    std::weak_ptr<WsClient> client;
    Clock::time_point at;  // when it was opened, or gave a place
  };
  std::map<std::string, GuestEye> guest_eyes_;  // by the guest's name
  std::pair<Role, Clock::time_point> hidden_{Role::look, Clock::time_point::min()};
  std::shared_ptr<std::map<std::string, Encoded>> encoded_;  // of projectors; the backroom's alone
  std::shared_ptr<Thumbnails> thumbnails_;                   // likewise
};

}  // namespace limn::remote
