// A folder of badly lit photos becomes a picture in normal light, and a scene for viewers:
//
//	reconstruct night_photos/ view.png scene.ply     (docs/languages.md)
package main

import (
	"context"
	"crypto/rand"
	"crypto/sha256"
	"encoding/hex"
	"fmt"
	"io"
	"log"
	"os"
	"path/filepath"
	"regexp"
	"strconv"
	"time"

	"google.golang.org/grpc"
	"google.golang.org/grpc/codes"
	"google.golang.org/grpc/status"
	"google.golang.org/protobuf/proto"

	pb "litags/v1"
)

var ctx = context.Background()

// must ends the program with what the service says: reason and field for programs, then the message.
func must[T any](result T, err error) T {
	if err != nil {
		for _, detail := range status.Convert(err).Details() {
			if known, ok := detail.(*pb.ErrorDetail); ok {
				log.Println(known.Reason, known.Field)
			}
		}
		log.Fatalln(err)
	}
	return result
}

func newID() string {
	id := make([]byte, 16)
	must(rand.Read(id))
	return hex.EncodeToString(id)
}

func upload(jobs pb.ReconstructionServiceClient, job string, photos []string) {
	stream := must(jobs.UploadImages(ctx))
	send := func(part *pb.UploadImagesRequest) { stream.Send(part) } // errors come with the answer
	send(&pb.UploadImagesRequest{Part: &pb.UploadImagesRequest_Name{Name: job}})
	for _, photo := range photos {
		data := must(os.ReadFile(photo))
		sum := sha256.Sum256(data)
		send(&pb.UploadImagesRequest{Part: &pb.UploadImagesRequest_File{File: &pb.FileHeader{
			Name: filepath.Base(photo), SizeBytes: int64(len(data)), Sha256: sum[:]}}})
		for chunk := 256 << 10; len(data) > 0; data = data[chunk:] {
			if chunk > len(data) {
				chunk = len(data)
			}
			send(&pb.UploadImagesRequest{Part: &pb.UploadImagesRequest_Chunk{Chunk: data[:chunk]}})
		}
	}
	send(&pb.UploadImagesRequest{Part: &pb.UploadImagesRequest_End{
		End: &pb.UploadEnd{Files: int32(len(photos))}}})
	must(stream.CloseAndRecv())
}

// watch follows the job to its end; a broken connection goes on after the last event that came.
func watch(jobs pb.ReconstructionServiceClient, job string) *pb.Job {
	for last, failures := int64(0), 0; ; time.Sleep(time.Second) {
		events, err := jobs.WatchJob(ctx, &pb.WatchJobRequest{Name: job, AfterEvent: last})
		for err == nil {
			var event *pb.JobEvent
			if event, err = events.Recv(); err == nil {
				last, failures = event.Number, 0
				if change := event.GetStateChange(); change != nil {
					fmt.Println(change.State, change.Message)
				}
			}
		}
		if err == io.EOF {
			return must(jobs.GetJob(ctx, &pb.GetJobRequest{Name: job}))
		}
		if failures++; status.Code(err) != codes.Unavailable || failures > 60 {
			must(job, err)
		}
	}
}

func main() {
	log.SetFlags(0)
	if len(os.Args) < 4 {
		log.Fatalln("give PHOTOS VIEW.png SCENE.ply [ITERATIONS]")
	}
	folder, picture, scene := os.Args[1], os.Args[2], os.Args[3]
	server := os.Getenv("LITAGS_SERVER")
	if server == "" {
		server = "127.0.0.1:50051"
	}
	options := &pb.JobOptions{} // what is not set is the server's default
	if len(os.Args) > 4 {
		options.Iterations = proto.Int32(int32(must(strconv.Atoi(os.Args[4]))))
	}
	var photos []string
	for _, file := range must(os.ReadDir(folder)) {
		if regexp.MustCompile(`(?i)\.(jpe?g|png)$`).MatchString(file.Name()) {
			photos = append(photos, filepath.Join(folder, file.Name()))
		}
	}
	channel := must(grpc.Dial(server, grpc.WithInsecure(),
		grpc.WithDefaultCallOptions(grpc.MaxCallRecvMsgSize(256<<20)))) // a picture may have more than 4 MiB
	jobs := pb.NewReconstructionServiceClient(channel)

	job := must(jobs.CreateJob(ctx,
		&pb.CreateJobRequest{RequestId: newID(), Options: options})).Name
	upload(jobs, job, photos)
	must(jobs.StartJob(ctx, &pb.StartJobRequest{Name: job, RequestId: newID()}))
	if done := watch(jobs, job); done.State != pb.JobState_JOB_STATE_SUCCEEDED {
		log.Fatalln(job, done.State, done.Error)
	}

	pictures := pb.NewRenderServiceClient(channel)
	placed := must(pictures.ListCameras(ctx, &pb.ListCamerasRequest{Name: job})).Cameras
	pose := &pb.Pose{Pose: &pb.Pose_Camera{Camera: placed[0].Name}}
	view := must(pictures.RenderView(ctx, &pb.RenderViewRequest{Name: job, Pose: pose}))
	must(picture, os.WriteFile(picture, view.Data, 0o644))
	parts := must(pb.NewModelServiceClient(channel).ExportModel(ctx,
		&pb.ExportModelRequest{Name: job}))
	size := must(parts.Recv()).GetHeader().SizeBytes
	var data []byte
	for int64(len(data)) < size {
		data = append(data, must(parts.Recv()).GetChunk()...)
	}
	must(scene, os.WriteFile(scene, data, 0o644))
}
