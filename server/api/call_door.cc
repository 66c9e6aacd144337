#include "server/api/call_door.h"

#include <grpc/slice.h>

#include <charconv>
#include <optional>
#include <string>
#include <string_view>

namespace litags {
namespace {

// A property of gRPC's for each connection, by which its calls are told from those of others.
constexpr char kNumber[] = "litags_connection";

std::optional<std::string> Property(const grpc_auth_context* context, const char* name) {
  auto found = grpc_auth_context_find_properties_by_name(context, name);
  const grpc_auth_property* const property = grpc_auth_property_iterator_next(&found);
  if (!property) return std::nullopt;
  return std::string(property->value, property->value_length);
}

uint64_t Parse(std::string_view text) {
  uint64_t number = 0;
  std::from_chars(text.data(), text.data() + text.size(), number);
  return number;
}

bool TakesMessages(const grpc::experimental::ServerRpcInfo& info) {
  using Type = grpc::experimental::ServerRpcInfo::Type;
  return info.type() == Type::CLIENT_STREAMING || info.type() == Type::BIDI_STREAMING;
}

// Lives as long as its call.
class OpenCall final : public grpc::experimental::Interceptor {
 public:
  OpenCall(Connections* connections, uint64_t number, grpc::experimental::ServerRpcInfo* info)
      : connections_(connections), number_(number), takes_messages_(TakesMessages(*info)) {
    connections_->WholeCall(number_, info->server_context()->peer(), takes_messages_);
  }
  ~OpenCall() override { connections_->EndCall(number_, takes_messages_); }
  void Intercept(grpc::experimental::InterceptorBatchMethods* methods) override {
    methods->Proceed();
  }

 private:
  Connections* const connections_;
  const uint64_t number_;
  const bool takes_messages_;
};

class OpenCallFactory final : public grpc::experimental::ServerInterceptorFactoryInterface {
 public:
  explicit OpenCallFactory(Connections* connections) : connections_(connections) {}
  grpc::experimental::Interceptor* CreateServerInterceptor(
      grpc::experimental::ServerRpcInfo* info) override {
    const uint64_t number = ConnectionNumber(*info->server_context());
    return number == 0 ? nullptr : new OpenCall(connections_, number, info);
  }

 private:
  Connections* const connections_;
};

}  // namespace

grpc_auth_metadata_processor CallDoor::AtHeaders() {
  const auto process = [](void* self, grpc_auth_context* context, const grpc_metadata* headers,
                          size_t count, grpc_process_auth_metadata_done_cb done, void* data) {
    const bool let_in = static_cast<CallDoor*>(self)->LetIn(context, headers, count);
    done(data, nullptr, 0, nullptr, 0, let_in ? GRPC_STATUS_OK : GRPC_STATUS_UNAVAILABLE,
         let_in ? nullptr : "too many calls are open; wait for some to end");
  };
  return {process, nullptr, this};
}

bool CallDoor::LetIn(grpc_auth_context* context, const grpc_metadata* headers, size_t count) {
  std::optional<std::string> authorization;
  for (size_t i = 0; i < count; ++i) {
    if (grpc_slice_str_cmp(headers[i].key, "authorization") != 0) continue;
    authorization.emplace(reinterpret_cast<const char*>(GRPC_SLICE_START_PTR(headers[i].value)),
                          GRPC_SLICE_LENGTH(headers[i].value));
    break;
  }
  std::optional<std::string> client;
  if (const auto known =
          authenticator_->Identify(authorization, Property(context, GRPC_X509_CN_PROPERTY_NAME));
      known.ok()) {
    client = known->name;
  }
  return connections_->OpenCall(NumberOf(context), client);
}

uint64_t CallDoor::NumberOf(grpc_auth_context* context) {
  // gRPC's context has no lock; this is the one place that changes it, before any handler sees it.
  std::lock_guard lock(mutex_);
  if (const auto number = Property(context, kNumber)) return Parse(*number);
  const std::string text = std::to_string(++last_number_);
  grpc_auth_context_add_cstring_property(context, kNumber, text.c_str());
  return last_number_;
}

std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface> CallDoor::WhenWhole() {
  return std::make_unique<OpenCallFactory>(connections_);
}

uint64_t ConnectionNumber(const grpc::ServerContextBase& context) {
  const auto auth = context.auth_context();
  if (!auth) return 0;
  const auto values = auth->FindPropertyValues(kNumber);
  return values.empty() ? 0 : Parse({values[0].data(), values[0].size()});
}

}  // namespace litags
