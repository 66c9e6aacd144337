// A job's report as a download: its answers are gathered from the services, as `litags report`
// does.
#include "client/report/report.h"

#include <google/protobuf/util/time_util.h>

#include <boost/asio/this_coro.hpp>

#include "server/web/api.h"
#include "server/web/failure.h"
#include "server/web/guard.h"

namespace litags::web {

namespace asio = boost::asio;

// The events that were there when the job was read.
asio::awaitable<grpc::Status> Api::ReadCourse(Exchange& exchange, const v1::Job& job,
                                              report::Course* course) {
  const asio::any_io_executor executor = co_await asio::this_coro::executor;
  const std::string authorization = AuthorizationOf(exchange.head());
  const auto call = Begin(exchange, "ReconstructionService/WatchJob", executor, authorization);
  v1::WatchJobRequest request;
  request.set_name(job.name());
  co_await call->WriteLast(request);
  v1::JobEvent event;
  while (event.number() < job.last_event()) {
    const RpcCall::Got got = co_await call->Read(&event);
    if (got != RpcCall::Got::kMessage) co_return co_await call->Finish();
    course->Add(event);
  }
  co_return grpc::Status::OK;
}

asio::awaitable<grpc::Status> Api::ReadScene(Exchange& exchange, report::ReportData* data,
                                             std::vector<HeldRoom>* held) {
  const std::string authorization = AuthorizationOf(exchange.head());
  v1::ListCamerasRequest cameras;
  cameras.set_name(data->job.name());
  grpc::Status status;
  do {
    v1::ListCamerasResponse page;
    status = co_await Unary(exchange, "RenderService/ListCameras", authorization, cameras, &page);
    if (!status.ok()) co_return status;
    cameras.set_page_token(page.next_page_token());
    data->cameras.MergeFrom(page);  // adds the cameras
  } while (!cameras.page_token().empty());
  data->pictures = report::PicturesOf(data->job, data->cameras);
  for (report::Picture& picture : data->pictures) {
    status = co_await Unary(exchange, "RenderService/RenderView", authorization, picture.request,
                            &picture.view, &held->emplace_back());
    if (!status.ok()) co_return status;
  }
  co_return grpc::Status::OK;
}

asio::awaitable<grpc::Status> Api::Gather(Exchange& exchange, const Route& route,
                                          const Message& request, report::ReportData* data,
                                          std::vector<HeldRoom>* held) {
  const std::string authorization = AuthorizationOf(exchange.head());
  grpc::Status status = co_await Unary(exchange, route.rpc, authorization, request, &data->job);
  if (!status.ok()) co_return status;
  const v1::GetServerInfoRequest about_server;
  status = co_await Unary(exchange, kInfoRpc, authorization, about_server, &data->server);
  if (!status.ok()) co_return status;
  status = co_await ReadCourse(exchange, data->job, &data->course);
  if (status.ok() && report::HasScene(data->job)) status = co_await ReadScene(exchange, data, held);
  data->made = google::protobuf::util::TimeUtil::GetCurrentTime();
  co_return status;
}

asio::awaitable<void> Api::Report(Exchange& exchange, const Route& route, const Message& request) {
  Answer answer;
  report::ReportData data;
  std::vector<HeldRoom> held;  // until it is sent
  const grpc::Status status = co_await Gather(exchange, route, request, &data, &held);
  if (status.ok()) {
    answer = {200, "text/html; charset=utf-8", report::ReportHtml(data), {}};
    answer.headers.emplace_back("Content-Disposition", AttachmentOf(data.job.name(), ".html"));
  } else {
    answer = Failure(status);
  }
  answer.headers.emplace_back("Cache-Control", "no-store");
  co_await exchange.Send(std::move(answer));
}

}  // namespace litags::web
