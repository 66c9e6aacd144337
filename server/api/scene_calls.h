// Calls that need a job's scene. While it is loaded they hold no thread.
#ifndef LITAGS_SERVER_API_SCENE_CALLS_H_
#define LITAGS_SERVER_API_SCENE_CALLS_H_

#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "server/api/answer_stream.h"
#include "server/api/scene_cache.h"
#include "server/api/unary.h"

namespace litags {

// As RunUnary(), with `work(call, cancel, scene)` of the job that the request names. No scene is
// looked for unless `check(call)` is OK.
template <typename Request, typename Check, typename Work>
grpc::ServerUnaryReactor* RunWithScene(Gate* gate, grpc::CallbackServerContext* context,
                                       CallName name, ThreadPool* pool, SceneCache* scenes,
                                       const Request* request, Check check, Work work) {
  return RunUnaryInSteps(
      gate, context, name, pool, request,
      [=, work = std::move(work)](Call& call, const CancelToken& cancel, UnaryReactor* reactor) {
        if (const absl::Status status = check(call); !status.ok()) return reactor->Answer(status);
        const auto answer = [=, &call, &cancel](const SceneCache::Result& scene) {
          if (cancel.IsCancelled()) return reactor->Answer(CallCancelled());
          reactor->Answer(scene.ok() ? work(call, cancel, **scene) : scene.status());
        };
        const auto snapshot = std::make_shared<SceneCache::Snapshot>();
        const auto scene = scenes->Get(call, cancel, request->name(), snapshot.get(),
                                       [=, held = snapshot](const SceneCache::Result& loaded) {
                                         if (!loaded.ok()) return reactor->Answer(loaded.status());
                                         reactor->GoOn(pool, [=] { answer(loaded); });
                                       });
        if (scene) answer(*scene);
      });
}

// A stream of answers about a job's scene.
template <typename Message>
class SceneStream : public AnswerStream<Message> {
 protected:
  SceneStream(std::shared_ptr<Call> call, grpc::CallbackServerContext* context, ThreadPool* pool,
              SceneCache* scenes)
      : AnswerStream<Message>(std::move(call), context, pool), scenes_(scenes) {}

  // Of the job called `name`, the same snapshot again while it is in memory. Null: Next() is to
  // return kLater, and is called once more.
  SceneCache::Result GetScene(const std::string& name) {
    if (loaded_) return *std::exchange(loaded_, std::nullopt);
    const auto scene = scenes_->Get(this->call(), this->cancel(), name, &snapshot_,
                                    [this](const SceneCache::Result& loaded) {
                                      loaded_ = loaded;
                                      this->GoOn();
                                    });
    return scene ? *scene : nullptr;
  }

 private:
  SceneCache* const scenes_;
  SceneCache::Snapshot snapshot_;
  std::optional<SceneCache::Result> loaded_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_API_SCENE_CALLS_H_
